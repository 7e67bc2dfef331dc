// Plays reports in headless Chromium: node .ci/replay.mjs FOLDER
import { createRequire } from "node:module";
import { resolve } from "node:path";
import assert from "node:assert/strict";

const folder = resolve(process.argv[2]);
const { chromium } = createRequire(`${folder}/`)("playwright-core");
const browser = await chromium.launch({
  executablePath: "/usr/bin/chromium",
  args: ["--no-sandbox", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync"],
});

const DESKTOP = { width: 1280, height: 900 };
const PHONE = { width: 390, height: 844 };

/** Opens a report. Fails on any error, and on any request but that for the page itself. */
async function open(name, viewport, colorScheme, options = {}) {
  const context = await browser.newContext({ viewport, colorScheme, ...options });
  const page = await context.newPage();
  page.on("pageerror", (error) => { throw error; });
  page.on("console", (message) => { if (message.type() === "error") throw new Error(message.text()); });
  const requests = [];
  page.on("request", (request) => requests.push(request.url()));
  const url = `file://${folder}/${name}/report.html`;
  await page.goto(url);
  assert.deepEqual(requests, [url]);
  return page;
}

/** Evaluates in the page, with what is shown as `replay`. */
const look = (page, code) => page.evaluate(`(() => { const replay = window.replay; return ${code}; })()`);
const node = (page, id) => look(page, `({ ...replay.record.byId.get(${id}).now, condition: replay.record.conditions[replay.record.byId.get(${id}).now.condition] })`);
const shot = (page, name) => page.locator(".replay").screenshot({ path: `${folder}/${name}.png` });

/** The killed master stops and is marked, the new leaders are shown, and the slider works by keyboard. */
async function death(viewport, colorScheme, label) {
  const page = await open("killed", viewport, colorScheme);
  const wide = await page.evaluate("document.documentElement.scrollWidth");
  assert.ok(wide <= viewport.width, `the page is ${wide} px wide on a screen of ${viewport.width} px`);
  const at = await look(page, 'replay.record.marks.find((mark) => mark.kind === "death").at');

  const slider = page.locator(".replay-slider");
  await slider.focus();
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press("Shift+ArrowRight");
  assert.equal(await look(page, "replay.time"), 11);
  await page.keyboard.press("ArrowLeft");
  assert.equal(await look(page, "replay.time"), 10);
  await page.keyboard.press("End");
  assert.equal(await look(page, "replay.time === replay.record.end"), true);
  await page.keyboard.press("Home");
  assert.equal(await look(page, "replay.time"), 0);

  await look(page, `replay.seek(${at - 5})`);
  const before = await node(page, 3);
  assert.equal(before.leads, true);
  await page.keyboard.press("Space");
  assert.equal(await look(page, "replay.isPlaying"), true);
  // The page's policy forbids `waitForFunction`, which evaluates text.
  while (await look(page, `replay.time <= ${at} + 0.5`)) await page.waitForTimeout(50);
  await page.keyboard.press("Space");
  assert.equal(await look(page, "replay.isPlaying"), false);
  await look(page, `replay.seek(${at} + 1)`);
  const dead = await node(page, 3);
  assert.equal(dead.condition, "dead");
  assert.equal(dead.leads, false);
  const leaders = await page.locator(".replay-leads").allTextContents();
  assert.deepEqual(leaders.sort(), ["drone 2 leads 2 drones", "drone 4 leads 2 drones"]);
  await shot(page, `${label}-death`);
  await look(page, `replay.seek(${at} + 40)`);
  const later = await node(page, 3);
  assert.ok(Math.hypot(later.north - dead.north, later.east - dead.east) < 0.5, "the dead drone has stopped");
  assert.equal(later.flies, false);

  // A click on a drone, a mark by keyboard, and the list.
  await look(page, `replay.seek(${at} + 12)`);
  const place = await look(page, "({ x: replay.map.x(replay.record.byId.get(4).now.east), y: replay.map.y(replay.record.byId.get(4).now.north) })");
  await page.locator(".replay-map").click({ position: place });
  assert.equal(await look(page, "replay.selected.id"), 4);
  assert.match(await page.locator(".replay-facts").textContent(), /Hops to leaderleads/);
  await shot(page, `${label}-selected`);
  await page.locator(".replay-mark").first().focus();
  assert.equal(await page.locator(".replay-tip").isVisible(), true);
  await page.keyboard.press("Enter");
  assert.ok(Math.abs(await look(page, "replay.time") - at) < 0.5);
  await page.locator(".replay-entry", { hasText: "drone 2 leads" }).click();
  assert.ok(await look(page, "replay.time") > at);
  await page.context().close();
}

/** What agents observed is plotted and told of the selected drone. */
async function values(viewport, colorScheme, label) {
  const page = await open("lanes", viewport, colorScheme);
  const wide = await page.evaluate("document.documentElement.scrollWidth");
  assert.ok(wide <= viewport.width, `the page is ${wide} px wide on a screen of ${viewport.width} px`);
  await look(page, "(replay.seek(replay.record.end), replay.select(0), 0)");
  assert.equal(await page.locator(".replay-value").count(), 1);
  assert.equal(await page.locator(".replay-values h3").textContent(), "findsdrone 0: 3");
  assert.match(await page.locator(".replay-facts").textContent(), /finds3/);
  await shot(page, `${label}-values`);
  await page.context().close();
}

/** Failures of agents are marks, and told of the selected drone. */
async function failures(viewport, colorScheme, label) {
  const page = await open("failing", viewport, colorScheme);
  const failed = 'replay.record.marks.filter((mark) => mark.kind === "agent failure" && mark.nodes.includes(2))';
  assert.equal(await look(page, `${failed}.length`), 6);
  assert.ok(await page.locator(".replay-mark").count() > 0);
  await look(page, `(replay.seek(${failed}[0].at - 1), replay.select(2), 0)`);
  assert.doesNotMatch(await page.locator(".replay-facts").textContent(), /Agent failed/);
  await look(page, "replay.seek(replay.record.end)");
  assert.match(await page.locator(".replay-facts").textContent(), /Agent failed6 times, last at /);
  await shot(page, `${label}-failures`);
  await page.context().close();
}

/** Frames a second while a hundred drones play. */
async function speed(viewport, label) {
  const page = await open("hundred", viewport, "light");
  const nodes = await look(page, "replay.record.nodes.length");
  assert.equal(nodes, 100);
  const frames = await page.evaluate(async () => {
    const player = window.replay;
    player.seek(player.record.end * 0.2);
    player.toggle();
    const times = [];
    await new Promise((done) => {
      const frame = (now) => {
        times.push(now);
        if (now - times[0] > 4000) done();
        else requestAnimationFrame(frame);
      };
      requestAnimationFrame(frame);
    });
    player.toggle();
    return { number: times.length - 1, took: (times.at(-1) - times[0]) / 1000 };
  });
  const rate = frames.number / frames.took;
  console.log(`${label}: ${rate.toFixed(1)} frames a second with ${nodes} drones, ${await look(page, "replay.record.links.length")} links`);
  await shot(page, `${label}-hundred`);
  assert.ok(rate >= 30, `${rate} frames a second`);
  await page.context().close();
}

for (const scheme of ["light", "dark"]) {
  await death(DESKTOP, scheme, `desktop-${scheme}`);
  await death(PHONE, scheme, `phone-${scheme}`);
  for (const check of [values, failures]) {
    await check(DESKTOP, scheme, `desktop-${scheme}`);
    await check(PHONE, scheme, `phone-${scheme}`);
  }
}
for (const name of ["thesis-2", "apart"]) {
  const page = await open(name, DESKTOP, "light");
  await look(page, "replay.seek(replay.record.end * 0.45)");
  await shot(page, name);
  await page.context().close();
}
// Without scripts there is no replay, and all else.
const plain = await open("killed", DESKTOP, "light", { javaScriptEnabled: false });
assert.equal(await plain.locator(".replay").isVisible(), false);
assert.equal(await plain.locator(".map").isVisible(), true);
await plain.context().close();
await speed(DESKTOP, "desktop");
await speed(PHONE, "phone");
await browser.close();
console.log("the replay works");
