// Values that agents observed: a small plot for each name, and what holds at a time.

/** Lines with at most so many points have a dot at each of them. */
const DOTTED_MAX = 40;

/** A value with at most four significant digits, but with all digits of its integer part. */
function short(value) {
  return Math.abs(value) >= 1000 ? value.toFixed(0) : `${+value.toPrecision(4)}`;
}

/** Makes a plot for each name, and a line about the names that have none. */
function valuePlots(place, record, theme) {
  const plots = record.values.map((series) => {
    const title = element("h3");
    const shown = element("span", "replay-now");
    title.append(element("span", "", series.thinned ? `${series.name} (extremes)` : series.name), shown);
    const canvas = element("canvas", "replay-plot replay-value");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${series.name}, as the agents observed it, over time`);
    const box = element("div");
    box.append(title, canvas);
    place.append(box);
    return { series, shown, plot: new TimePlot(canvas, record, theme, (plot) => paintSeries(plot, series)) };
  });
  if (record.omittedValues.length > 0) {
    place.append(element("p", "about", `Not plotted: ${record.omittedValues.join(", ")}. report.json has all values.`));
  }
  return plots;
}

/** The values of a name as steps: each holds until the drone reports the next. The selected drone's are bold. */
function paintSeries(plot, { lines }) {
  const { context, theme, height, selected } = plot;
  let [low, high] = [Infinity, -Infinity];
  for (const { values } of lines) {
    for (const value of values) [low, high] = [Math.min(low, value), Math.max(high, value)];
  }
  const step = roundStep((high - low || Math.abs(high) || 1) / 2);
  [low, high] = [Math.floor(low / step) * step, Math.ceil(high / step) * step];
  if (low === high) high += step;
  const y = (value) => 14 + (1 - (value - low) / (high - low)) * (height - 34);
  paintTimes(plot);
  const grid = [];
  for (let value = low; value <= high + step / 2; value += step) grid.push(+value.toPrecision(6));
  paintValues(plot, grid, y, "");
  const isSelected = (line) => line.drone === selected?.id;
  for (const line of [...lines.filter((it) => !isSelected(it)), ...lines.filter(isSelected)]) {
    const isBold = isSelected(line);
    context.globalAlpha = isBold ? 1 : lines.length > 30 ? 0.3 : 0.6;
    context.lineWidth = isBold ? 3 : 1.4;
    context.strokeStyle = theme.get(isBold ? "--ink" : "--accent");
    context.fillStyle = context.strokeStyle;
    paintSteps(plot, line, y);
  }
  context.globalAlpha = 1;
}

function paintSteps(plot, { times, values }, y) {
  const { context } = plot;
  context.beginPath();
  times.forEach((time, index) => {
    const x = plot.x(time);
    if (index === 0) context.moveTo(x, y(values[0]));
    else context.lineTo(x, y(values[index - 1]));
    context.lineTo(x, y(values[index]));
  });
  context.stroke();
  if (times.length > DOTTED_MAX) return;
  times.forEach((time, index) => {
    context.beginPath();
    context.arc(plot.x(time), y(values[index]), 2.5, 0, 2 * Math.PI);
    context.fill();
  });
}

/** What holds at `time`: the selected drone's value, or that of the only drone, or the range of all. */
function valueAt({ lines }, time, selected) {
  const known = [];
  for (const { drone, times, values } of lines) {
    const last = lastBefore(times, time);
    if (last >= 0) known.push({ drone, value: values[last] });
  }
  const own = selected && known.find(({ drone }) => drone === selected.id);
  const one = own || (known.length === 1 && known[0]);
  if (one) return `drone ${one.drone}: ${short(one.value)}`;
  if (known.length === 0) return "";
  const all = known.map(({ value }) => value);
  return `${known.length} drones: ${short(Math.min(...all))} to ${short(Math.max(...all))}`;
}
