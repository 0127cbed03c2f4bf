// What a client has of the world: the objects that updates brought, as docs/client-protocol.md says under "update".

/** The objects near a client, after the newest update that was applied. */
export class Replica {
  constructor() {
    /** number → { number, generation, shape, category, user, metadata, position, orientation } */
    this.objects = new Map();
    this.contacts = [];
    this.touching = [];
    this.own = null;
    this.frame = -1;
  }
  /** Frame of the newest applied update plus 1, which the client acknowledges; 0: none. */
  get acknowledgement() { return this.frame + 1; }

  /** False if the update is out of date, or is based on one that this replica has not. */
  apply(update) {
    if (update.frame <= this.frame) return false;
    if (update.since !== 0 && update.frame - update.since > this.frame) return false;
    if (update.since === 0) this.objects.clear();
    for (const number of update.removed) this.objects.delete(number);
    for (const { ...object } of update.entered) this.objects.set(object.number, object);
    for (const moved of update.moved) {
      const object = this.objects.get(moved.number);
      if (object === undefined) throw new RangeError(`object ${moved.number} moves, but has not entered`);
      object.position = moved.position;
      if (moved.orientation !== null) object.orientation = moved.orientation;
    }
    this.contacts = update.contacts;
    this.touching = update.touching;
    this.own = update.own;
    this.frame = update.frame;
    return true;
  }
}
