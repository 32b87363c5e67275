/* The page "Learn in the browser": sliders, and two legs drawn while they run, feedback only beside CMAC. leg.js runs
 * them on what docs/browser.py packed. */
"use strict";
(() => {
const DATA = globalThis.cmacexpData;
const { period, transfer, sampling_period: sample_time, lengths, hip_height: hip, force: pressed } = DATA;
const MOST_CYCLES = 400, FEEDBACK = 0, CMAC = 1, FROZEN = 2, FEEDBACK_ONLY = 4;
const X_REFERENCE = 0, Y_REFERENCE = 1, X = 2, Y = 3, Q1 = 6, Q2 = 7, FORCE = 10;
const CAUSES = ["", "a step went far beyond feedback only", "feedback only was better", "effort and error drifted",
  "feedback only chattered, which leaves nothing to learn from"];
const samples = (count) => `${count} sample${count === 1 ? "" : "s"}`;
const counted = (settings) => settings.delay + 1;

const SLIDERS = [
  { name: "mass", label: "Mass of each link", stops: [0.25, 0.35, 0.5, 0.7, 1, 1.4, 2], show: (s) => `${s.mass} kg` },
  { name: "stiffness", label: "Stiffness of the ground", stops: DATA.stiffnesses,
    show: (s) => `${s.stiffness} N/m` },
  { name: "delay", label: "Delay of the torque", stops: DATA.guarded_rates.map((_, i) => i),
    show: (s) => `${samples(s.delay)}, ${Math.round(1000 * sample_time * s.delay)} ms` },
  { name: "rate", label: "Rate of learning", stops: [0.01, 0.02, 0.05, 0.1, 0.1953125, 0.3, 0.5, 1],
    show: (s, model) => {
      const acts = model ? model.actingRate(s) : s.rate;
      return acts < s.rate ? `${+s.rate.toFixed(2)}, limited to ${acts.toFixed(2)} by the guard` : `${+s.rate.toFixed(2)}`;
    } },
  { name: "lead", label: "Lead of learning", stops: [...Array(13).keys()],
    show: (s) => {
      const off = s.lead - counted(s);
      return `${samples(s.lead)}, ${off === 0 ? "right" : `${Math.abs(off)} too ${off < 0 ? "short" : "long"}`}`;
    } },
];
const SOFT = { mass: 0.5, stiffness: 10, delay: 2, rate: 0.1953125, lead: 3, guard: true };
const PRESETS = [
  ["Right lead", SOFT],
  ["Lead too short", { ...SOFT, lead: 0, guard: false }],
  ["Lead too long", { ...SOFT, delay: 0, lead: 6, guard: false }],
  ["Too short, guarded", { ...SOFT, lead: 0 }],
];

/** Two legs over the same cycles, and what the page draws of them. */
class Run {
  static async start(model, settings) {
    const run = new Run();
    run.settings = settings;
    run.legs = [await model.leg({ ...settings, learns: false }), await model.leg(settings)];
    run.now = run.legs.map(() => new Float64Array(period * LEG_COLUMNS)); // of the cycle under way
    run.last = run.legs.map(() => null); // the last whole cycle
    run.errors = run.legs.map(() => ({ foot: [], force: [] })); // of whole cycles: mm in the air, N on the ground
    run.sample = run.cycles = 0;
    run.events = [];
    return run;
  }

  get over() {
    return this.cycles >= MOST_CYCLES || this.legs.some((leg) => leg.diverged);
  }

  advance(steps) {
    while (steps > 0 && !this.over) {
      const count = Math.min(steps, period - this.sample), rows = this.legs.map((leg) => leg.take(count));
      rows.forEach((own, i) => this.now[i].set(own, this.sample * LEG_COLUMNS));
      this.sample += Math.min(...rows.map((own) => own.length)) / LEG_COLUMNS;
      steps -= count;
      this.noteGuard();
      if (this.sample === period && !this.legs.some((leg) => leg.diverged)) this.endCycle();
    }
  }

  noteGuard() {
    const guard = this.legs[CMAC].guard(), known = this.events.at(-1);
    if (guard.cause > 0 && guard.step !== known?.step)
      this.events.push({ ...guard, cycle: Math.floor(guard.step / period) + 1 });
  }

  endCycle() {
    this.now.forEach((rows, i) => {
      let foot = 0, force = 0;
      for (let k = 0; k < period; k++) {
        const at = k * LEG_COLUMNS;
        if (k < transfer) foot += (rows[at] - rows[at + X]) ** 2 + (rows[at + Y_REFERENCE] - rows[at + Y]) ** 2;
        else force += (rows[at + FORCE] - pressed) ** 2;
      }
      this.errors[i].foot.push(1000 * Math.sqrt(foot / transfer));
      this.errors[i].force.push(Math.sqrt(force / (period - transfer)));
      this.last[i] = rows.slice();
    });
    this.cycles++;
    this.sample = 0;
  }

  /** How it goes, in plain words. */
  verdict() {
    const { settings: s, cycles } = this, right = counted(s), [feedback, cmac] = this.legs;
    const late = `it learns with lead ${s.lead}, and feedback comes ${samples(right)} after its torque`;
    const tooFast = this.legs[CMAC].rate > 2 * DATA.guarded_rates[s.delay], remedies = [];
    if (s.lead !== right) remedies.push(`set the lead to ${right}`);
    if (tooFast || s.lead === right) remedies.push("lower the rate");
    const remedy = `To mend it, ${remedies.join(" and ")}${s.guard ? "" : ", or switch the guard on"}.`;
    if (feedback.diverged)
      return `Feedback only diverged in cycle ${cycles + 1}: with this mass, stiffness and delay the loop is unstable, ` +
        "whatever learns. Take a heavier leg, softer ground or a shorter delay.";
    if (cmac.diverged) return `The leg with CMAC diverged in cycle ${cycles + 1}: ${late}. ${remedy}`;
    const done = cycles >= MOST_CYCLES ? ` All ${cycles} cycles are done.` : "", event = this.events.at(-1);
    if (event) {
      const since = event.phase === FROZEN ? `the torque of cycle ${event.restored} is repeated` : "feedback acts alone";
      return `The guard ended learning in cycle ${event.cycle}: ${CAUSES[event.cause]}. Since then ${since}.${done}`;
    }
    if (cycles < 1) return "Both legs still do the same: in the first cycle there is nothing learnt yet.";
    if (cycles < 3) return "The CMAC has begun to learn the torque that feedback gave.";
    const foot = this.errors[CMAC].foot, share = foot.at(-1) / this.errors[FEEDBACK].foot.at(-1);
    if (Math.min(...foot.slice(-5)) > 1.5 * Math.min(...foot)) return `The error grows again: ${late}. ${remedy}${done}`;
    return `The CMAC learns: the foot's error is ${+(100 * share).toPrecision(2)} % of that of feedback only.${done}`;
  }
}

/* Drawing. */
const make = (tag, parent, attributes = {}, text = "") => {
  const node = parent.appendChild(document.createElement(tag));
  Object.entries(attributes).forEach(([name, value]) => node.setAttribute(name, value));
  node.append(text);
  return node;
};

/** The context of a canvas, cleared and scaled to its size on the page, and the colours of the scheme. */
function begin(canvas) {
  const { clientWidth: width, clientHeight: height } = canvas, dots = devicePixelRatio || 1;
  canvas.width = Math.round(width * dots);
  canvas.height = Math.round(height * dots);
  const context = canvas.getContext("2d"), style = getComputedStyle(canvas);
  context.scale(dots, dots);
  context.font = `12px ${style.fontFamily}`;
  context.lineJoin = context.lineCap = "round";
  const colour = (name) => style.getPropertyValue(`--learn-${name}`).trim();
  return { context, width, height, colours: [colour("feedback"), colour("cmac")], text: style.color,
    faint: colour("faint"), ground: colour("ground") };
}

function line(context, points, colour, width = 1.5, dash = []) {
  context.beginPath();
  points.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.setLineDash(dash);
  context.stroke();
  context.setLineDash([]);
}

function dot(context, [x, y], radius, colour) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fillStyle = colour;
  context.fill();
}

/** Points of the rows `from` to `to` by two functions of a row's place. */
const trail = (rows, from, to, point) => {
  const points = [];
  for (let k = from; k < to; k += 2) points.push(point(k * LEG_COLUMNS, rows));
  return points;
};

function drawLeg(canvas, run) {
  const { context, width, height, colours, text, faint, ground } = begin(canvas);
  const scale = Math.min(width / 0.8, height / 0.84);
  const place = (x, y) => [width / 2 + scale * x, scale * (y + 0.06)];
  const at = Math.max(run.sample - 1, 0) * LEG_COLUMNS;
  const rows = run.now.map((now, i) => (run.sample === 0 && run.last[i]) ? run.last[i] : now);
  const from = run.sample === 0 && run.last[0] ? (period - 1) * LEG_COLUMNS : at;
  const feet = rows.map((own) => [own[from + X], own[from + Y]]);
  const surface = [];
  for (let x = -0.6; x <= 0.6; x += 0.01) {
    const dips = feet.map(([fx, fy]) => Math.max(0, fy - hip) * Math.exp(-(((x - fx) / 0.07) ** 2)));
    surface.push(place(x, hip + Math.max(...dips)));
  }
  context.beginPath();
  [[0, height], ...surface, [width, height]].forEach(([x, y]) => context.lineTo(x, y));
  context.fillStyle = ground;
  context.fill();
  const path = (own, to, point, ...style) => line(context, trail(own, 0, to, point), ...style);
  const foot = (k, own) => place(own[k + X], own[k + Y]);
  path(rows[CMAC], Math.max(run.sample, run.last[CMAC] ? period : 0), (k, own) => {
    const planned = run.last[CMAC] || own; // the same in every cycle
    return place(planned[k + X_REFERENCE], k < transfer * LEG_COLUMNS ? planned[k + Y_REFERENCE] : hip + pressed / run.settings.stiffness);
  }, text, 1, [2, 5]);
  [FEEDBACK, CMAC].forEach((i) => {
    if (run.last[i]) path(run.last[i], period, foot, colours[i] + "60", 1.5);
    path(rows[i], run.sample, foot, colours[i], 2);
    const [q1, q2] = [rows[i][from + Q1], rows[i][from + Q2]];
    const knee = [lengths[0] * Math.cos(q1), lengths[0] * Math.sin(q1)];
    const tip = [knee[0] + lengths[1] * Math.cos(q1 + q2), knee[1] + lengths[1] * Math.sin(q1 + q2)];
    const joints = [place(0, 0), place(...knee), place(...tip)];
    if (!joints.flat().every(Number.isFinite)) return;
    line(context, joints, colours[i] + (i === CMAC ? "" : "90"), i === CMAC ? 6 : 4);
    joints.forEach((joint) => dot(context, joint, i === CMAC ? 5 : 3, colours[i]));
  });
  line(context, [place(-0.07, 0), place(0.07, 0)], faint, 3);
}

/** Axes of a plot over x and y ranges; returns what draws on them. */
function axes(canvas, title, [x0, x1], [y0, y1], xTicks, yTicks, log = false) {
  const frame = begin(canvas), { context, width, height, text, faint } = frame;
  const left = 44, right = width - 10, top = 24, bottom = height - 20, scaled = log ? Math.log10 : (y) => y;
  const px = (x) => left + ((right - left) * (x - x0)) / (x1 - x0);
  const py = (y) => bottom - ((bottom - top) * (scaled(Math.min(Math.max(y, y0), y1)) - scaled(y0))) / (scaled(y1) - scaled(y0));
  context.fillStyle = text;
  context.fillText(title, 4, 13);
  context.textAlign = "right";
  yTicks.forEach((y) => {
    line(context, [[left, py(y)], [right, py(y)]], faint, 0.5);
    context.fillText(y, left - 5, py(y) + 4);
  });
  context.textAlign = "center";
  xTicks.forEach((x) => context.fillText(x, px(x), height - 5));
  const plot = (points, ...style) => line(context, points.map(([x, y]) => [px(x), py(y)]), ...style);
  return { ...frame, px, py, top, bottom, plot };
}

function drawForce(canvas, run) {
  const time = period * sample_time, forces = run.last[FEEDBACK] || run.now[FEEDBACK];
  let highest = 2 * pressed;
  for (let k = FORCE; k < forces.length; k += LEG_COLUMNS)
    if (forces[k] > highest) highest = Math.min(1.1 * forces[k], 20 * pressed); // false of NaN
  const ticks = [...Array(Math.floor(highest / (highest > 5 ? 5 : 1)) + 1).keys()].map((n) => n * (highest > 5 ? 5 : 1));
  const { plot, colours, text } = axes(canvas, "Force on the ground, N, over a cycle, s", [0, time], [0, highest], [0, 1, 2, 3], ticks);
  const touch = transfer * sample_time;
  const curve = (rows, to) => trail(rows, 0, to, (k) => [(k / LEG_COLUMNS) * sample_time, rows[k + FORCE]]);
  plot([[touch, pressed], [time, pressed]], text, 1, [2, 5]);
  [FEEDBACK, CMAC].forEach((i) => {
    if (run.last[i]) plot(curve(run.last[i], period), colours[i] + "60");
    plot(curve(run.now[i], run.sample), colours[i], 2);
  });
}

function drawErrors(canvas, run, name, title, lowest, highest) {
  const values = run.errors.map((errors) => errors[name]), all = values.flat().filter(Number.isFinite);
  while (all.some((value) => value > highest)) highest *= 10;
  while (all.some((value) => value < lowest) && lowest > 1e-9) lowest /= 10;
  const count = Math.max(20, run.cycles), stride = 5 * 10 ** Math.floor(Math.log10(count / 10));
  const xTicks = [1], yTicks = [];
  for (let x = stride; x <= count; x += stride) xTicks.push(x);
  for (let y = lowest; y < 1.01 * highest; y *= 10) yTicks.push(+y.toPrecision(1));
  const { plot, px, context, top, bottom, colours, text } = axes(canvas, title, [1, count], [lowest, highest], xTicks, yTicks, true);
  values.forEach((own, i) => plot(own.map((value, k) => [k + 1, value]), colours[i], 2));
  run.events.forEach(({ cycle }) => {
    line(context, [[px(cycle), top], [px(cycle), bottom]], text, 1, [4, 3]);
    context.fillStyle = text;
    context.textAlign = px(cycle) > canvas.clientWidth - 60 ? "right" : "left";
    context.fillText(" guard ", px(cycle), top + 10);
  });
}

/* The page. */
function build(root) {
  root.textContent = "";
  const ui = { inputs: {}, outputs: {} };
  const button = (parent, label) => make("button", parent, { type: "button" }, label);
  const canvas = (parent, name, label) => make("canvas", parent, { class: `learn-${name}`, role: "img", "aria-label": label });
  const presets = make("div", root, { class: "learn-bar", role: "group", "aria-label": "Examples" });
  ui.presets = PRESETS.map(([label]) => button(presets, label));
  ui.verdict = make("p", root, { class: "learn-verdict", role: "status" }, "Starting.");
  const grid = make("div", root, { class: "learn-grid" });
  const legs = make("div", grid);
  ui.leg = canvas(legs, "leg", "The two legs on soft ground, and the paths of their feet");
  const legend = make("p", legs, { class: "learn-legend" });
  [["feedback", "feedback only"], ["cmac", "with CMAC"], ["planned", "planned"]].forEach(([name, label]) =>
    make("span", legend, { class: `learn-key-${name}` }, label));
  const controls = make("div", grid, { class: "learn-controls" });
  SLIDERS.forEach(({ name, label, stops }) => {
    const row = make("label", controls, {}, `${label}: `);
    ui.outputs[name] = make("output", row);
    ui.inputs[name] = make("input", row, { type: "range", min: 0, max: stops.length - 1, step: 1 });
  });
  const guard = make("label", controls);
  ui.guard = make("input", guard, { type: "checkbox" });
  guard.append(" Guard of learning");
  const bar = make("div", controls, { class: "learn-bar" });
  ui.pause = button(bar, "Pause");
  ui.restart = button(bar, "Start again");
  const speed = make("label", bar, {}, "Speed ");
  ui.speed = make("select", speed);
  [1, 6, 30].forEach((times) => make("option", ui.speed, { value: times }, times === 1 ? "real time" : `${times} times`));
  ui.speed.value = 6;
  ui.cycle = make("span", bar, { class: "learn-cycle" });
  const plots = make("div", grid);
  ui.force = canvas(plots, "plot", "Force on the ground over a cycle");
  ui.footErrors = canvas(plots, "plot", "Error of the foot in each cycle");
  ui.forceErrors = canvas(plots, "plot", "Error of the force in each cycle");
  ui.command = make("code", make("p", root, { class: "learn-command" }, "The same run in Python: "));
  return ui;
}

async function show(root) {
  const ui = build(root), calm = matchMedia("(prefers-reduced-motion: reduce)");
  let settings = SOFT, run = null, paused = false, due = 0, before = 0, started = 0, drawn = "";
  const model = await LegModel.load(DATA);
  const read = () => {
    settings = Object.fromEntries(SLIDERS.map(({ name, stops }) => [name, stops[ui.inputs[name].value]]));
    settings.guard = ui.guard.checked;
    restart();
  };
  const put = (chosen) => {
    SLIDERS.forEach(({ name, stops }) => { ui.inputs[name].value = stops.indexOf(chosen[name]); });
    ui.guard.checked = chosen.guard;
    read();
  };
  const setPaused = (value) => {
    paused = value;
    ui.pause.textContent = paused ? "Go on" : "Pause";
  };
  async function restart() {
    SLIDERS.forEach(({ name, show: text }) => {
      ui.outputs[name].textContent = text(settings, model);
      ui.inputs[name].setAttribute("aria-valuetext", text(settings, model));
    });
    ui.command.textContent = `python -m cmacexp ${LegModel.overrides(settings, 50)}`;
    ui.presets.forEach((button, i) =>
      button.setAttribute("aria-pressed", Object.entries(PRESETS[i][1]).every(([name, value]) => settings[name] === value)));
    const number = ++started, fresh = await Run.start(model, settings);
    if (number !== started) return; // a slider has moved meanwhile
    run = fresh;
    due = 0;
    setPaused(false);
  }
  function draw() {
    drawLeg(ui.leg, run);
    drawForce(ui.force, run);
    const verdict = run.verdict();
    if (ui.verdict.textContent !== verdict) ui.verdict.textContent = verdict;
    ui.cycle.textContent = `cycle ${Math.min(run.cycles + 1, MOST_CYCLES)}`;
    const { clientWidth, ownerDocument } = ui.force, scheme = ownerDocument.body.dataset.mdColorScheme;
    const state = [started, run.cycles, run.events.length, clientWidth, scheme].join();
    if (state === drawn) return; // the rest changes once a cycle
    drawn = state;
    drawErrors(ui.footErrors, run, "foot", "Error of the foot in the air, mm, over cycles", 0.1, 100);
    drawErrors(ui.forceErrors, run, "force", "Error of the force, N, over cycles", 0.001, 1);
  }
  function tick(now) {
    const passed = Math.min(now - before, 500) / 1000;
    before = now;
    if (run) {
      if (!paused && !run.over) due += (passed * ui.speed.value) / sample_time;
      const unit = calm.matches ? period : 1, steps = Math.floor(due / unit) * unit;
      due -= steps;
      run.advance(steps);
      draw();
    }
    requestAnimationFrame(tick);
  }
  [...Object.values(ui.inputs), ui.guard].forEach((input) => input.addEventListener("input", read));
  ui.presets.forEach((button, i) => button.addEventListener("click", () => put(PRESETS[i][1])));
  ui.pause.addEventListener("click", () => setPaused(!paused));
  ui.restart.addEventListener("click", () => restart());
  put(SOFT);
  requestAnimationFrame(tick);
}

const root = document.getElementById("learn");
show(root).catch((error) => {
  root.textContent = `This browser cannot run the leg: ${error.message}. It needs WebAssembly and DecompressionStream.`;
});
})();
