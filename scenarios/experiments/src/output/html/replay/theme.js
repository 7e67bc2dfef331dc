// Colours of the page's theme, and canvases.

/** Colours of marks. */
const KIND_COLOURS = {
  fault: "--fault", death: "--bad", return: "--good", restart: "--fault", "agent failure": "--fault", election: "--vote", leader: "--good",
  partition: "--part", merge: "--part", waypoint: "--soft", "early landing": "--fault", "broken rule": "--bad",
};
const EPOCH_COLOURS = 8;

/** Colours of the page's theme, for canvases. */
class Theme {
  constructor(element) {
    this.element = element;
    this.read();
  }

  read() {
    const style = getComputedStyle(this.element);
    const colour = (name) => style.getPropertyValue(name).trim();
    this.colours = {};
    const names = ["--ink", "--soft", "--line", "--grid", "--ground", "--card", "--accent", "--good", "--bad", "--pin", "--fault", "--vote", "--part", "--no-leader"];
    for (const name of names) this.colours[name] = colour(name);
    this.epochs = Array.from({ length: EPOCH_COLOURS }, (_, index) => colour(`--epoch-${index}`));
  }

  get(name) {
    return this.colours[name];
  }

  epoch(index) {
    return index < 0 ? this.colours["--no-leader"] : this.epochs[index % EPOCH_COLOURS];
  }

  kind(kind) {
    return this.colours[KIND_COLOURS[kind]];
  }
}

/** Sizes a canvas to its element. Returns its context, in CSS pixels. */
function sized(canvas) {
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const { clientWidth: width, clientHeight: height } = canvas;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  return { context, width, height };
}

/** A round number, 1, 2 or 5 times a power of ten, that is at least `rough`. */
function roundStep(rough) {
  const power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].find((factor) => factor * power >= rough * 0.999) * power;
}
