// The player: time, controls, marks and keys.

const SPEEDS = [0.25, 0.5, 1, 2, 5, 10, 20, 50];
/** Seconds that a whole replay takes at the speed that is chosen first. */
const LASTS = 45;
/** Marks nearer to each other than this are one button, in pixels. */
const MARK_WIDTH = 16;

/** Kinds of marks, the most important first. */
const RANKS = ["broken rule", "death", "fault", "leader", "election", "partition", "merge", "return", "early landing", "agent failure", "restart", "waypoint"];

function mostImportant(marks) {
  return marks.reduce((a, b) => (RANKS.indexOf(b.kind) < RANKS.indexOf(a.kind) ? b : a));
}

/** Changes a text only if it differs: a page that lays itself out for each frame is slow. */
function write(place, text) {
  if (place.textContent !== text) place.textContent = text;
}

class Player {
  constructor(section, record) {
    this.section = section;
    this.record = record;
    this.theme = new Theme(section);
    this.markTimes = record.marks.map((mark) => mark.at);
    this.time = 0;
    this.selected = null;
    this.isPlaying = false;
    this.find = (name) => section.querySelector(`.replay-${name}`);
    this.map = new SwarmMap(this.find("map"), record, this.theme);
    this.panel = new Panel(section, record, this.theme, (time) => this.seek(time));
    this.plots = [["strip", paintLeaders], ["altitudes", paintAltitudes], ["closest", paintClosest]].map(
      ([name, paint]) => new TimePlot(this.find(name), record, this.theme, paint),
    );
    this.values = valuePlots(this.find("values"), record, this.theme);
    this.plots.push(...this.values.map(({ plot }) => plot));
    this.slider = this.find("slider");
    this.slider.max = String(Math.ceil(record.end * 10) / 10);
    this.find("clock-end").textContent = record.end.toFixed(1);
    // Links of large swarms, and of runs without rules, are not recorded.
    this.find("shows-links").parentElement.hidden = !record.links;
    this.chooseSpeed();
    this.listDrones();
    this.listen();
    this.resize();
  }

  chooseSpeed() {
    const wanted = this.record.end / LASTS;
    this.speed = SPEEDS.reduce((a, b) => (Math.abs(Math.log(b / wanted)) < Math.abs(Math.log(a / wanted)) ? b : a));
    const choice = this.find("speed");
    choice.replaceChildren(...SPEEDS.map((speed) => new Option(`${speed}×`, speed, false, speed === this.speed)));
    choice.addEventListener("change", () => { this.speed = Number(choice.value); });
  }

  listDrones() {
    const choice = this.find("drone");
    const option = (node) => new Option(node.fixed ? `relay ${node.id}` : `drone ${node.id}`, node.id);
    choice.replaceChildren(new Option("none", ""), ...this.record.nodes.map(option));
    choice.addEventListener("change", () => this.select(choice.value === "" ? null : Number(choice.value)));
  }

  listen() {
    this.slider.addEventListener("input", () => this.seek(Number(this.slider.value)));
    this.find("play").addEventListener("click", () => this.toggle());
    this.find("previous").addEventListener("click", () => this.step(-1));
    this.find("next").addEventListener("click", () => this.step(1));
    for (const name of ["links", "tree", "trails", "names"]) {
      const box = this.find(`shows-${name}`);
      box.addEventListener("change", () => { this.map.shows[name] = box.checked; this.draw(); });
    }
    for (const mode of ["whole", "swarm"]) {
      this.find(mode).addEventListener("click", () => { this.map.mode = mode; this.map.aim(); this.draw(); });
    }
    this.find("in").addEventListener("click", () => { this.map.zoom(1.5); this.draw(); });
    this.find("out").addEventListener("click", () => { this.map.zoom(1 / 1.5); this.draw(); });
    this.section.addEventListener("keydown", (event) => this.key(event));
    // Keys work after a press anywhere in the replay.
    this.section.tabIndex = -1;
    this.section.addEventListener("pointerdown", (event) => {
      if (!event.target.closest("button, input, select, label")) this.section.focus({ preventScroll: true });
    });
    for (const plot of this.plots) this.scrub(plot);
    new Pointers(this.map, (node) => this.select(node ? node.id : null), () => this.draw());
    new ResizeObserver(() => this.resize()).observe(this.section);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.retheme());
  }

  /** Pressing and dragging on a plot chooses the time. */
  scrub(plot) {
    const seek = (event) => this.seek(plot.timeAt(event.offsetX));
    plot.canvas.addEventListener("pointerdown", (event) => {
      plot.canvas.setPointerCapture(event.pointerId);
      seek(event);
    });
    plot.canvas.addEventListener("pointermove", (event) => { if (event.buttons & 1) seek(event); });
  }

  /** Keys work wherever the focus is in the replay, unless a control has a use of its own for them. */
  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("select")) return;
    const isButton = event.target.matches("button, input[type=checkbox]");
    const far = event.shiftKey ? 10 : 1;
    const keys = {
      " ": () => this.toggle(),
      ArrowLeft: () => this.seek(this.time - far),
      ArrowRight: () => this.seek(this.time + far),
      Home: () => this.seek(0),
      End: () => this.seek(this.record.end),
      n: () => this.step(1),
      p: () => this.step(-1),
      "+": () => { this.map.zoom(1.5); this.draw(); },
      "-": () => { this.map.zoom(1 / 1.5); this.draw(); },
      Escape: () => this.select(null),
    };
    const act = keys[event.key];
    if (!act || (isButton && event.key === " ")) return;
    event.preventDefault();
    act();
  }

  seek(time) {
    this.time = Math.min(Math.max(time, 0), this.record.end);
    this.draw();
  }

  /** Jumps to the next mark or the one before. */
  step(direction) {
    const marks = this.record.marks.filter((mark) => mark.kind !== "waypoint");
    const ahead = direction > 0
      ? marks.find((mark) => mark.at > this.time + 0.01)
      : marks.findLast((mark) => mark.at < this.time - 0.01);
    this.seek(ahead ? ahead.at : direction > 0 ? this.record.end : 0);
  }

  select(id) {
    this.selected = this.record.byId.get(id) ?? null;
    this.map.selected = this.selected;
    this.find("drone").value = this.selected ? String(id) : "";
    for (const plot of this.plots.slice(1)) Object.assign(plot, { selected: this.selected, isStale: true });
    this.draw();
  }

  toggle() {
    this.isPlaying = !this.isPlaying;
    const play = this.find("play");
    play.setAttribute("aria-label", this.isPlaying ? "Pause" : "Play");
    play.classList.toggle("is-playing", this.isPlaying);
    if (!this.isPlaying) return;
    if (this.time >= this.record.end) this.time = 0;
    let before = null;
    const frame = (now) => {
      if (!this.isPlaying) return;
      if (before !== null) this.time += ((now - before) / 1000) * this.speed;
      before = now;
      if (this.time >= this.record.end) {
        this.time = this.record.end;
        this.toggle();
      }
      this.draw(0.15);
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  /** Draws what holds at the time; the map moves by a `share` of the way to what it follows. */
  draw(share = 1) {
    const { record, time } = this;
    for (const plot of this.plots) plot.draw(time);
    record.look(time);
    this.map.aim(share);
    this.map.draw(time, this.isPlaying ? this.speed : 1);
    this.panel.update(time, this.selected);
    this.slider.value = String(time);
    this.slider.setAttribute("aria-valuetext", `${seconds(time)} of ${seconds(record.end)}`);
    this.write("clock-now", time.toFixed(1));
    this.write("caption", this.caption());
    const closest = record.closestAt(time);
    this.write("closest-now", closest ? `${closest.distance.toFixed(1)} m, drones ${closest.a} and ${closest.b}` : "");
    this.write("altitude-now", this.selected ? `drone ${this.selected.id}: ${this.selected.now.height.toFixed(1)} m` : "");
    for (const { series, shown } of this.values) write(shown, valueAt(series, time, this.selected));
    for (const mode of ["whole", "swarm"]) this.find(mode).setAttribute("aria-pressed", String(this.map.mode === mode));
  }

  write(name, text) {
    write(this.find(name), text);
  }

  /** The last thing that has happened; of several at once the most important, and all of its kind. */
  caption() {
    const { marks } = this.record;
    const last = marks[lastBefore(this.markTimes, this.time + 1e-6)];
    if (!last) return "";
    const atOnce = marks.filter((mark) => mark.at <= last.at && mark.at > last.at - 0.05);
    const chief = mostImportant(atOnce);
    const texts = atOnce.filter((mark) => mark.kind === chief.kind).map((mark) => mark.text);
    return `${seconds(chief.at)}: ${texts.slice(0, 2).join("; ")}${texts.length > 2 ? "; …" : ""}`;
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.map.canvas;
    // Nothing is seen, as on paper.
    if (width === 0 || height === 0) return;
    this.map.size = { width, height };
    if (this.placed !== this.slider.clientWidth) {
      this.placed = this.slider.clientWidth;
      this.placeMarks();
    }
    this.draw();
  }

  retheme() {
    this.theme.read();
    for (const plot of this.plots) plot.isStale = true;
    this.panel.shown.leaders = "";
    this.draw();
  }

  /** Buttons for marks above the slider; marks close together share one. */
  placeMarks() {
    const lane = this.find("marks");
    const x = (mark) => INSET + (mark.at / this.record.end) * (lane.clientWidth - 2 * INSET);
    const clusters = [];
    for (const mark of this.record.marks) {
      if (mark.kind === "waypoint") continue;
      const last = clusters[clusters.length - 1];
      if (last && x(mark) - x(last[0]) < MARK_WIDTH) last.push(mark);
      else clusters.push([mark]);
    }
    lane.replaceChildren(...clusters.map((marks) => this.markButton(marks, x(marks[0]))));
  }

  markButton(marks, x) {
    const chief = mostImportant(marks);
    const button = element("button", `replay-mark kind-${chief.kind.replace(/ /g, "-")}`, marks.length > 1 ? String(marks.length) : "");
    const lines = marks.slice(0, 8).map((mark) => `${seconds(mark.at)}: ${mark.text}`);
    if (marks.length > 8) lines.push(`and ${marks.length - 8} more`);
    button.type = "button";
    button.style.left = `${x.toFixed(1)}px`;
    button.setAttribute("aria-label", lines.join("; "));
    button.addEventListener("click", () => this.seek(chief.at));
    const show = () => this.tip(lines, x);
    for (const event of ["pointerenter", "focus"]) button.addEventListener(event, show);
    for (const event of ["pointerleave", "blur"]) button.addEventListener(event, () => this.tip([], x));
    return button;
  }

  /** What a mark says, beside it. */
  tip(lines, x) {
    const tip = this.find("tip");
    tip.hidden = lines.length === 0;
    tip.replaceChildren(...lines.map((line) => element("p", "", line)));
    const room = this.find("marks").clientWidth - tip.clientWidth;
    tip.style.left = `${Math.max(0, Math.min(x - tip.clientWidth / 2, room))}px`;
  }
}

{
  const section = document.querySelector(".replay");
  const data = JSON.parse(document.getElementById("record").textContent);
  section.hidden = false;
  // For tests and a browser's console: what is shown, at which time.
  window.replay = new Player(section, new RunRecord(data));
}
