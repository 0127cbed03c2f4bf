// How messages reach the gateway. Another transport has the same members: onopen, onmessage(bytes), onclose({code,
// reason}), send(bytes), close().

/** Messages over a WebSocket. `url` is http, https, ws or wss, with the path. */
export class WebSocketTransport {
  constructor(url, WebSocketClass) {
    this.onopen = this.onmessage = this.onclose = () => {};
    this.socket = new WebSocketClass(url.replace(/^http/, "ws"));
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => this.onopen();
    this.socket.onmessage = ({ data }) => this.onmessage(new Uint8Array(data));
    this.socket.onclose = ({ code, reason }) => this.onclose({ code, reason: String(reason) });
    this.socket.onerror = () => {}; // a close follows, which says what happened
  }
  send(bytes) {
    if (this.socket.readyState === 1) this.socket.send(bytes);
  }
  close() { this.socket.close(1000); }
}
