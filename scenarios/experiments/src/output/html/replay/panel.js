// What is written beside the map: the selected drone, who leads, and what happened.

/** Most entries of the list of what happened. */
const LISTED_MAX = 600;

/** A new element with text. */
function element(name, className, text) {
  const made = document.createElement(name);
  if (className) made.className = className;
  if (text !== undefined) made.textContent = text;
  return made;
}

function seconds(time) {
  return `${time.toFixed(1)} s`;
}

class Panel {
  constructor(section, record, theme, jump) {
    Object.assign(this, { record, theme, jump });
    this.facts = section.querySelector(".replay-facts");
    this.leaders = section.querySelector(".replay-leaders");
    this.list = section.querySelector(".replay-list");
    this.shown = { leaders: "", facts: "", entry: null };
    this.entries = record.marks.slice(0, LISTED_MAX).map((mark) => this.entry(mark));
    this.times = this.entries.map(({ mark }) => mark.at);
    this.list.replaceChildren(...this.entries.map(({ item }) => item));
    if (record.marks.length > LISTED_MAX) {
      this.list.append(element("li", "replay-more", `and ${record.marks.length - LISTED_MAX} more`));
    }
  }

  entry(mark) {
    const item = element("li");
    const button = element("button", `replay-entry kind-${mark.kind.replace(/ /g, "-")}`);
    button.type = "button";
    button.append(element("span", "replay-when", mark.at.toFixed(1)), element("span", "", mark.text));
    button.addEventListener("click", () => this.jump(mark.at));
    item.append(button);
    return { mark, item, button };
  }

  update(time, selected) {
    this.updateLeaders();
    this.updateFacts(selected, time);
    this.updateList(time);
  }

  /** Who leads whom, one line for each leader epoch. */
  updateLeaders() {
    const lines = this.record.groups().map(({ epoch, members, leader }) => {
      const others = members.length - (leader ? 1 : 0);
      const count = `${others} drone${others === 1 ? "" : "s"}`;
      if (leader) return { epoch, text: `drone ${leader.id} leads ${others === 0 ? "no other drone" : count}`, lead: true };
      if (epoch < 0) return { epoch, text: `${count} without a leader`, lead: false };
      return { epoch, text: `${count} still ${others === 1 ? "follows" : "follow"} drone ${this.record.epochs[epoch].master}`, lead: false };
    });
    if (lines.length === 0) lines.push({ epoch: -1, text: "no drone flies any more", lead: false });
    const key = JSON.stringify(lines);
    if (key === this.shown.leaders) return;
    this.shown.leaders = key;
    this.leaders.replaceChildren(...lines.map(({ epoch, text, lead }) => {
      const line = element("li", lead ? "replay-leads" : "", text);
      line.style.setProperty("--epoch", this.theme.epoch(epoch));
      return line;
    }));
  }

  updateFacts(node, time) {
    const facts = node ? [...this.factsOf(node), ...this.agentOf(node, time)] : [];
    const key = JSON.stringify(facts);
    if (key === this.shown.facts) return;
    this.shown.facts = key;
    this.facts.hidden = !node;
    this.facts.replaceChildren(...facts.map(([name, value]) => {
      const row = element("div");
      row.append(element("dt", "", name), element("dd", "", value));
      return row;
    }));
  }

  factsOf(node) {
    const { now } = node;
    const { record } = this;
    const epoch = now.epoch < 0 ? null : record.epochs[now.epoch];
    const state = now.state < 0 ? "relays" : record.states[now.state].name;
    const condition = now.condition === RUNS ? "" : `${record.conditions[now.condition]}, was `;
    const hops = now.leads ? "leads" : now.hops < 0 ? "no route" : `${now.hops}`;
    const rows = [
      ["State", `${condition}${state}`],
      ["Leader", epoch ? `drone ${epoch.master}, term ${epoch.term}` : "none"],
      ["Parent", now.leads || now.parent < 0 ? "–" : `drone ${now.parent}`],
      ["Hops to leader", hops],
      ["Waypoint", now.waypoint < 0 ? "–" : `${now.waypoint}`],
      ["Altitude", `${now.height.toFixed(1)} m`],
      ["North, east", `${now.north.toFixed(1)} m, ${now.east.toFixed(1)} m`],
    ];
    if (record.swarms.length > 1) rows.unshift(["Swarm", record.swarms[node.swarm].name]);
    return rows;
  }

  /** Failures of its agent until `time`, and the last value of each name. */
  agentOf(node, time) {
    const failures = this.record.marks.filter((mark) => mark.kind === "agent failure" && mark.at <= time && mark.nodes.includes(node.id));
    const rows = this.record.values.flatMap(({ name, lines }) => {
      const line = lines.find(({ drone }) => drone === node.id);
      const last = line ? lastBefore(line.times, time) : -1;
      return last < 0 ? [] : [[name, short(line.values[last])]];
    });
    if (failures.length > 0) {
      const last = failures[failures.length - 1];
      rows.unshift(["Agent failed", `${failures.length === 1 ? "" : `${failures.length} times, last `}at ${seconds(last.at)}`]);
    }
    return rows;
  }

  /** Highlights the last entry that has happened, and scrolls the list to it. */
  updateList(time) {
    const last = lastBefore(this.times, time + 1e-6);
    if (last === this.shown.entry) return;
    const before = this.entries[this.shown.entry];
    if (before) before.button.removeAttribute("aria-current");
    this.shown.entry = last;
    const entry = this.entries[last];
    if (!entry) return;
    entry.button.setAttribute("aria-current", "time");
    const { offsetTop } = entry.item;
    this.list.scrollTop = offsetTop - this.list.clientHeight / 2;
  }
}
