// Light and dark colours of the page and of the world.

export const themes = {
  light: { sky: 0xdfe3e6, ground: 0xe7e3da, grid: 0xd3cec3, light: 2.0, ambient: 1.35,
    categories: [0x2f6fb3, 0x4f9a8c, 0xc49a5a, 0xa9acb2], own: 0xd9632a, flash: 0xe8412c, ghost: 0x9a4fc4 },
  dark: { sky: 0x14171c, ground: 0x20242b, grid: 0x343a44, light: 2.0, ambient: 1.2,
    categories: [0x6ea8e6, 0x5fb5a5, 0xd0a968, 0x6a707b], own: 0xf08a55, flash: 0xff6a50, ghost: 0xc084ea },
};

const nodeHues = [210, 25, 150, 45, 280, 0, 180, 95, 320, 240];

/** CSS colour of a CD node, the same in the regions, the charts and the table. */
export function nodeColour(id, isDark) {
  const hue = (nodeHues[id % nodeHues.length] + 17 * Math.floor(id / nodeHues.length)) % 360;
  return `hsl(${hue}, 62%, ${isDark ? 62 : 48}%)`;
}

/** Remembers the choice of the visitor; without one the system decides. */
export class Theme {
  constructor(root, onChange) {
    this.root = root;
    this.onChange = onChange;
    this.system = matchMedia("(prefers-color-scheme: dark)");
    this.system.addEventListener("change", () => this.apply());
    this.apply();
  }
  get chosen() { try { return localStorage.getItem("theme"); } catch { return null; } }
  get isDark() { return (this.chosen ?? (this.system.matches ? "dark" : "light")) === "dark"; }
  get colours() { return this.isDark ? themes.dark : themes.light; }
  toggle() {
    try { localStorage.setItem("theme", this.isDark ? "light" : "dark"); } catch { /* private window */ }
    this.apply();
  }
  apply() {
    this.root.classList.toggle("dark", this.isDark);
    this.onChange(this);
  }
}
