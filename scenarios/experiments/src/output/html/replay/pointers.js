// The map under the pointer.

/** Pointers on the map: a click selects, a drag moves, two fingers or the wheel zoom. */
class Pointers {
  constructor(map, select, draw) {
    Object.assign(this, { map, select, draw });
    this.down = new Map();
    this.moved = 0;
    const { canvas } = map;
    canvas.addEventListener("pointerdown", (event) => this.press(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", (event) => this.release(event));
    canvas.addEventListener("pointercancel", (event) => this.down.delete(event.pointerId));
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
  }

  press(event) {
    if (this.down.size === 0) this.moved = 0;
    this.down.set(event.pointerId, event);
    this.map.canvas.setPointerCapture(event.pointerId);
  }

  move(event) {
    const before = this.down.get(event.pointerId);
    if (!before) return;
    const [dx, dy] = [event.offsetX - before.offsetX, event.offsetY - before.offsetY];
    this.moved += Math.hypot(dx, dy);
    const other = [...this.down.values()].find((it) => it.pointerId !== event.pointerId);
    this.down.set(event.pointerId, event);
    if (this.moved < 4) return;
    if (other) {
      const distance = (it) => Math.max(Math.hypot(it.offsetX - other.offsetX, it.offsetY - other.offsetY), 1);
      const [x, y] = [(event.offsetX + other.offsetX) / 2, (event.offsetY + other.offsetY) / 2];
      this.map.zoom(distance(event) / distance(before), x, y);
    } else {
      this.map.pan(dx, dy);
    }
    this.draw();
  }

  release(event) {
    this.down.delete(event.pointerId);
    if (this.moved < 4 && this.down.size === 0) this.select(this.map.nodeAt(event.offsetX, event.offsetY));
  }

  /** The wheel scrolls the page unless the map has the focus. */
  wheel(event) {
    if (document.activeElement !== this.map.canvas && !event.ctrlKey) return;
    event.preventDefault();
    this.map.zoom(Math.exp(-event.deltaY * 0.0015), event.offsetX, event.offsetY);
    this.draw();
  }
}
