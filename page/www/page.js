"use strict";

/** Ticks of the instrument in a second. */
const TICKS = 400;
/** Most ticks between two pictures: ten seconds. */
const MOST_TICKS = 4000;
/** Seconds of rates that are drawn, and lines that are kept. */
const SECONDS = 180;
const LINES = 60;

const byId = (id) => document.getElementById(id);
const radians = (degrees) => (degrees * Math.PI) / 180;
const show = (id, text) => { if (byId(id).textContent !== text) byId(id).textContent = text; };
const signed = (value, digits) => (value < 0 ? "−" : "+") + Math.abs(value).toFixed(digits);
/** A number that may not be one: the sigma of a dwell of a single second, say. */
const digits = (value, count) => (value === null ? "?" : value.toFixed(count));
const between = (degrees) => ((((degrees + 180) % 360) + 360) % 360) - 180;

/** Least and most of what is to be seen: without the few values, a kick's, that would make the others small. */
function range(values) {
  const sorted = values.toSorted((a, b) => a - b);
  const few = Math.floor(sorted.length / 40);
  return [sorted[few], sorted[sorted.length - 1 - few]];
}

/** What the instrument said since it powered up. */
class Heard {
  constructor() {
    this.state = "idle";
    this.seconds = [];
    this.log = [];
    this.restart();
  }

  /** A fix begins. */
  restart() {
    Object.assign(this, { points: [], means: [], fix: null, trueAtFix: null, coarse: null, words: [], fault: null, toGo: null, gates: {} });
  }

  take({ t_s, name, event, words }) {
    const kind = typeof event === "string" ? event : Object.keys(event)[0];
    const what = event[kind];
    switch (kind) {
      case "State":
        if (what === "Levelling") this.restart();
        if (what === "Watching") this.gates.disturbance = "watch";
        if (what === "Settling") this.gates.jitter = "watch";
        this.state = name;
        this.say(t_s, name);
        break;
      case "Second": this.second(what); break;
      case "Dwell":
        this.means.push([what.index_deg, what.rate_deg_h]);
        this.say(t_s, `dwell at ${what.index_deg.toFixed(2)}°: ${signed(what.rate_deg_h, 4)} ± ${digits(what.sigma_deg_h, 4)} °/h in ${what.seconds} s`);
        break;
      case "Undisturbed": this.gates.disturbance = "open"; this.say(t_s, "base still"); break;
      case "Disturbed": this.gates.disturbance = "shut"; this.say(t_s, `disturbed: ${what.excess_deg_h.toFixed(2)} °/h above the Earth's rate`); break;
      case "Settled": this.gates.jitter = "open"; this.say(t_s, "gyro at rest"); break;
      case "Jitter": this.gates.jitter = "shut"; this.say(t_s, `jitter: ${signed(what.change_deg_h, 2)} °/h from second to second`); break;
      case "Moving": this.say(t_s, `turns to ${what.target_deg.toFixed(2)}°`); break;
      case "Coarse": this.coarse = what; this.say(t_s, `coarse azimuth ${what.azimuth_deg.toFixed(2)}° ± ${digits(what.sigma_deg, 2)}°`); break;
      case "FallenBack": this.say(t_s, `the mirrored four positions follow, ${what.dwell_s} s each`); break;
      case "ToGo": this.toGo = t_s + what.seconds; break;
      case "Fix": Object.assign(this, { fix: what, words, toGo: null }); this.say(t_s, `azimuth ${what.azimuth_deg.toFixed(4)}° ± ${what.sigma_deg.toFixed(4)}°`); break;
      case "Fault": Object.assign(this, { fault: words[0], words, toGo: null }); this.say(t_s, `${name}: ${words[0].meaning}`); break;
      case "IndexSlipped": this.say(t_s, `the index slipped; it was at ${what.before_deg.toFixed(2)}°`); break;
      default:
    }
  }

  second(second) {
    this.last = second;
    const kind = second.waited_at ? "shut" : second.collected ? "dot" : "out";
    this.seconds.push([second.t_s, second.rate_deg_h, kind]);
    if (this.seconds.length > SECONDS) this.seconds.shift();
    if (second.collected && second.index_deg !== null) this.points.push([second.index_deg, second.rate_deg_h]);
  }

  say(t_s, text) {
    this.log.push([t_s, text]);
    if (this.log.length > LINES) this.log.shift();
    this.spoke = true;
  }
}

/** The page: hands on the instrument, and what is seen of it. */
class Page {
  constructor(instrument) {
    this.instrument = instrument;
    this.sinusoid = new Chart(byId("sinusoid"), "index angle, °", "rate, °/h");
    this.rates = new Chart(byId("rates"), "time, s", "rate, °/h");
    this.acts = [];
    this.owed = 0;
    this.dragged = 0;
    drawRose();
    this.wire();
  }

  /** A refusal is shown until a person does something else. */
  act(what) {
    const answer = this.instrument.act(what);
    if (answer.error || what.wait === undefined) show("refused", answer.error ?? "");
    if (answer.truth) this.truth = answer.truth;
    for (const report of answer.reports) this.heard.take(report);
    if (this.heard.fix) this.heard.trueAtFix ??= this.truth.azimuth_deg;
    return answer;
  }

  /** An instrument that is refused leaves the one that is there. */
  powerUp(chosen) {
    const before = this.heard;
    this.heard = new Heard();
    const { error } = this.act({ "power-up": chosen });
    if (error) {
      this.heard = before ?? this.heard;
      return;
    }
    this.acts = [];
    this.heard.spoke = true;
    this.drawn = null;
    for (const chart of [this.sinusoid, this.rates]) chart.clear();
    byId("pitch").value = this.truth.pitch_deg;
    byId("roll").value = this.truth.roll_deg;
    show("about", this.about.get(chosen.scenario) ?? "");
  }

  chosen() {
    const number = (id) => (byId(id).value === "" ? null : Number(byId(id).value));
    const order = byId("order").value;
    return {
      scenario: byId("scenario").value,
      seed: number("seed") ?? 1,
      latitude_deg: number("latitude"),
      arw_deg_per_sqrt_h: number("class"),
      order: { adaptive: { adaptive: { accuracy_deg: 0.04 } }, rotation: { rotation: {} } }[order] ?? (order || null),
    };
  }

  wire() {
    const { scenarios } = this.instrument.act("scenarios");
    this.about = new Map(scenarios);
    byId("scenario").replaceChildren(...scenarios.map(([name]) => new Option(name)));
    byId("start").onclick = () => this.act("start");
    byId("abort").onclick = () => this.act("abort");
    byId("power").onclick = () => this.powerUp(this.chosen());
    for (const button of document.querySelectorAll("[data-act]")) {
      button.onclick = () => this.act(JSON.parse(button.dataset.act));
    }
    // The other tilt is kept, also beyond what a slider shows.
    byId("pitch").onchange = (event) => this.act({ tilt: [Number(event.target.value), this.truth.roll_deg] });
    byId("roll").onchange = (event) => this.act({ tilt: [this.truth.pitch_deg, Number(event.target.value)] });
    this.wireDrag(byId("instrument"));
  }

  /** The instrument is turned by as much as the pointer goes round it. */
  wireDrag(svg) {
    const bearing = (event) => {
      const box = svg.getBoundingClientRect();
      const [x, y] = [event.clientX - box.left - box.width / 2, event.clientY - box.top - box.height / 2];
      return (Math.atan2(x, -y) * 180) / Math.PI;
    };
    let last = null;
    byId("grip").onpointerdown = (event) => {
      svg.setPointerCapture(event.pointerId);
      svg.classList.add("held");
      last = bearing(event);
    };
    svg.onpointermove = (event) => {
      if (last === null) return;
      this.dragged += between(bearing(event) - last);
      last = bearing(event);
    };
    svg.onpointerup = svg.onpointercancel = () => {
      svg.classList.remove("held");
      if (last !== null && Math.abs(this.dragged) > 0.5) this.act({ turn: this.dragged });
      [last, this.dragged] = [null, 0];
    };
  }

  /** Lets as much time pass as the speed asks for, but works no longer on it than `patience_ms`. */
  pass(elapsed_s, patience_ms) {
    if (!this.truth) return;
    const speed = Number(byId("speed").value);
    this.owed = Math.min(speed === 0 ? MOST_TICKS : this.owed + TICKS * speed * elapsed_s, MOST_TICKS);
    const until = performance.now() + patience_ms;
    while (this.owed >= 1 && performance.now() < until) {
      const ticks = Math.min(Math.floor(this.owed), TICKS);
      this.act({ wait: ticks });
      this.owed -= ticks;
      while (this.acts.length && this.acts[0].at_s <= this.truth.t_s) this.act(this.acts.shift().act);
    }
  }

  draw() {
    const { truth, heard } = this;
    if (!truth) return;
    this.drawInstrument();
    this.drawResult();
    if (heard.last) this.drawCharts();
    if (heard.spoke) {
      heard.spoke = false;
      const lines = heard.log.map(([t_s, text]) => {
        const line = document.createElement("li");
        const time = document.createElement("time");
        time.textContent = `${t_s.toFixed(1)} s`;
        line.append(time, text);
        return line;
      });
      byId("log").replaceChildren(...lines.reverse());
    }
  }

  drawInstrument() {
    const { truth, heard } = this;
    const azimuth = truth.azimuth_deg + this.dragged;
    byId("body").setAttribute("transform", `rotate(${azimuth})`);
    byId("gyro").setAttribute("transform", `rotate(${azimuth - truth.index_deg})`);
    const found = heard.fix ?? heard.coarse;
    byId("needle").setAttribute("visibility", found ? "visible" : "hidden");
    byId("needle").setAttribute("class", heard.fix ? "" : "coarse");
    if (found) byId("needle").setAttribute("transform", `rotate(${azimuth - found.azimuth_deg})`);
    // The bubble goes to the higher side: nose up is up, left side up is left.
    const [up, left] = [truth.pitch_deg, truth.roll_deg].map((deg) => Math.max(-6, Math.min(6, 9 * deg)));
    byId("air").setAttribute("cx", -left);
    byId("air").setAttribute("cy", -up);
    byId("air").setAttribute("class", Math.max(Math.abs(truth.pitch_deg), Math.abs(truth.roll_deg)) > 0.5 ? "air off" : "air");
  }

  drawResult() {
    const { truth, heard } = this;
    const { fix, fault, coarse, last } = heard;
    const waiting = last?.waited_at && !fix;
    show("state", waiting ? `${heard.state}, ${last.waited_at.toLowerCase()}` : heard.state);
    byId("state").className = `badge ${waiting ? "waiting" : heard.state}`;
    show("clock", `${truth.t_s.toFixed(1)} s`);
    show("azimuth", fix ? `${fix.azimuth_deg.toFixed(4)}°` : fault ? fault.name : "–");
    byId("azimuth").className = `number ${fix ? (heard.words.length ? "flagged" : "clear") : fault ? "failed" : ""}`;
    show("sigma", fix ? `± ${fix.sigma_deg.toFixed(4)}°` : "");
    show("truth", `${truth.azimuth_deg.toFixed(4)}°`);
    const error = fix && between(fix.azimuth_deg - heard.trueAtFix);
    show("error", fix ? `${signed(error, 4)}°, ${Math.abs(error / fix.sigma_deg).toFixed(1)} σ` : "–");
    show("coarse", coarse ? `${coarse.azimuth_deg.toFixed(2)}°` : "–");
    show("togo", heard.toGo ? `${Math.max(0, heard.toGo - truth.t_s).toFixed(0)} s` : "–");
    show("index", last?.index_deg == null ? "–" : `${last.index_deg.toFixed(3)}°`);
    show("rate", last ? `${signed(last.rate_deg_h, 4)} °/h` : "–");
    show("tilt", `${signed(truth.pitch_deg, 3)}°, ${signed(truth.roll_deg, 3)}°`);
    show("temperature", `${truth.temp_c.toFixed(2)} °C`);
    this.drawGates();
    const words = heard.words.map(({ name, meaning, remedy }) => `${name}\n${meaning}\n${remedy}`).join("\n\n");
    if (byId("words").dataset.text !== words) {
      byId("words").dataset.text = words;
      byId("words").replaceChildren(...heard.words.map((word) => doubt(word, Boolean(fault))));
    }
    Object.assign(document.body.dataset, {
      state: heard.state,
      azimuth: fix ? String(fix.azimuth_deg) : "",
      sigma: fix ? String(fix.sigma_deg) : "",
      words: heard.words.map(({ name }) => name).join(" "),
    });
  }

  drawGates() {
    const { truth, heard } = this;
    const [disturbance, jitter] = truth.thresholds_deg_h;
    const rates = heard.seconds.slice(-2).map(([, rate]) => Math.abs(rate));
    const excess = rates.length ? signed(rates.at(-1) - truth.north_deg_h, 2) : "–";
    const change = rates.length === 2 ? signed(rates[1] - rates[0], 2) : "–";
    for (const [id, text] of [
      ["disturbance", `|ω| − Ω cos φ = ${excess} °/h, limit ${disturbance.toFixed(2)}`],
      ["jitter", `change ${change} °/h, limit ±${jitter.toFixed(2)}`],
    ]) {
      byId(id).className = `gate ${heard.gates[id] ?? ""}`;
      const value = byId(id).querySelector("span");
      if (value.textContent !== text) value.textContent = text;
    }
  }

  drawCharts() {
    const { truth, heard } = this;
    const end = heard.last.t_s;
    if (this.drawn === end && this.drawnFix === heard.fix) return;
    [this.drawn, this.drawnFix] = [end, heard.fix];
    const { fix, coarse, points, means, seconds } = heard;
    const model = fix
      ? { azimuth: fix.azimuth_deg, amplitude: fix.amplitude_deg_h, bias: fix.bias_deg_h }
      : coarse && { azimuth: coarse.azimuth_deg, amplitude: truth.north_deg_h, bias: 0 };
    const curve = [];
    for (let index = 0; model && index <= 360; index += 3) {
      curve.push([index, model.bias + model.amplitude * Math.cos(radians(model.azimuth - index))]);
    }
    this.sinusoid.begin([0, 360], range([...points, ...curve].map(([, rate]) => rate)), 45);
    this.sinusoid.curve(curve, fix ? "fit" : "fit coarse");
    this.sinusoid.dots(points, "dot", 2.4);
    this.sinusoid.dots(means, "mean", 5);
    this.rates.begin([Math.max(0, end - SECONDS), Math.max(end, SECONDS)], range(seconds.map(([, rate]) => rate)), 30);
    for (const kind of ["out", "dot", "shut"]) this.rates.dots(seconds.filter((second) => second[2] === kind), kind, 2.2);
  }
}

/** A flag or a fault with what it means and what to do. */
function doubt({ name, meaning, remedy }, isFault) {
  const line = document.createElement("li");
  const [title, advice] = [document.createElement("b"), document.createElement("i")];
  [title.textContent, advice.textContent] = [name, `→ ${remedy}`];
  if (isFault) line.className = "fault";
  line.append(title, meaning, advice);
  return line;
}

function drawRose() {
  for (let azimuth = 0; azimuth < 360; azimuth += 5) {
    const length = azimuth % 90 === 0 ? 9 : azimuth % 10 === 0 ? 5 : 3;
    byId("rose").append(shape("line", { y1: -96, y2: -96 - length, transform: `rotate(${azimuth})` }));
  }
  ["N", "E", "S", "W"].forEach((name, number) => {
    const [x, y] = [112 * Math.sin(radians(90 * number)), -112 * Math.cos(radians(90 * number))];
    byId("rose").append(shape("text", { x, y: y + 4, class: number ? "" : "north" }, name));
  });
  for (let index = 0; index < 360; index += 30) {
    byId("scale").append(shape("line", { y1: -56, y2: -52, transform: `rotate(${-index})` }));
    if (index % 90 === 0) byId("scale").append(shape("text", { y: -46, transform: `rotate(${-index})` }, `${index}°`));
  }
}

/** Sets a field of the page to what the address asks for; refuses what the field does not have, and leaves it as it was. */
function choose(id, value) {
  const before = byId(id).value;
  byId(id).value = value;
  if (byId(id).value === value) return;
  byId(id).value = before;
  throw new Error(`${id}=${value} in the address: there is no such choice`);
}

/** An act of the address, say shock=60:600: time in seconds, size. */
function timed(name, text) {
  const [at_s, size] = text.split(":").map(Number);
  if (!Number.isFinite(at_s) || !Number.isFinite(size)) throw new Error(`${name}=${text} in the address: time in s and size are needed, as in 60:600`);
  return { at_s, act: { [name]: size } };
}

/** What the address asks for after its #: a choice, acts at times (shock=60:600), and a fix at once (start, once), after which time
 * stands still. Whether it is the last. */
function script(page) {
  const asked = new URLSearchParams(location.hash.slice(1));
  for (const id of ["scenario", "seed", "latitude", "class", "order", "speed"]) if (asked.has(id)) choose(id, asked.get(id));
  const acts = ["shock", "warm", "turn"].flatMap((name) => asked.getAll(name).map((text) => timed(name, text)));
  page.powerUp({ ...page.chosen(), azimuth_deg: asked.has("azimuth") ? Number(asked.get("azimuth")) : null });
  page.acts = acts.sort((one, other) => one.at_s - other.at_s);
  if (asked.has("start") && page.truth) page.act("start");
  return asked.has("once");
}

async function run() {
  addEventListener("hashchange", () => location.reload());
  const page = new Page(await Instrument.load(NORTH_WASM));
  let once = false;
  try {
    once = script(page);
  } catch (error) {
    // An address that asks for what is not there gets the usual instrument, and is told why.
    page.powerUp(page.chosen());
    show("refused", error.message);
  }
  let before = null;
  const frame = (now) => {
    const elapsed_s = before === null ? 0 : (now - before) / 1000;
    const goesOn = () => page.truth && !page.heard.fix && !page.heard.fault;
    if (!once) page.pass(elapsed_s, 14);
    for (let n = 0; once && n < 60 && goesOn(); n += 1) page.pass(1, Infinity);
    before = now;
    page.draw();
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
}

run().catch((error) => {
  show("refused", `the instrument could not be loaded: ${error}`);
  console.error(error);
});
