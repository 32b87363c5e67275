/* One leg that learns: benchmarks/one_leg.c as WebAssembly, on what docs/browser.py packed. Pages and Node use it alike;
 * tests/commands/test_browser.py compares its numbers with those of Python, to the bit. */
"use strict";

const LEG_COLUMNS = 16;
const NEVER = 1n << 62n;
const PAGE_BYTES = 65536;

/** The bytes of a text in base64, inflated. */
async function inflate(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** The plan of each stiffness, as docs/browser.py packed them by columns: law and state at the start, and tables. */
function unpackPlans(bytes, { stiffnesses, period, tables, shared, law_bytes, state_bytes }) {
  const sizes = Object.fromEntries(tables.map(([name, , size]) => [name, size])), count = stiffnesses.length;
  let read = 0;
  const next = (size) => bytes.slice(read, (read += size));
  const starts = stiffnesses.map(() => next(law_bytes + state_bytes));
  const same = Object.fromEntries(shared.map((name) => [name, next(sizes[name])]));
  const references = new Float64Array(next(count * sizes.reference).buffer);
  const steps = new Int16Array(next((count * sizes.inputs) / 4).buffer); // of quanta, from sample to sample
  const columns = sizes.inputs / period / 8;
  return new Map(stiffnesses.map((stiffness, i) => {
    const reference = new Float64Array(sizes.reference / 8), inputs = new Float64Array(sizes.inputs / 8);
    const rows = 2 * period, width = reference.length / rows;
    for (let k = 0; k < rows; k++)
      for (let c = 0; c < width; c++) reference[k * width + c] = references[(c * count + i) * rows + k];
    for (let c = 0; c < columns; c++)
      for (let k = 0, quantum = 0.5; k < period; k++) // its middle
        inputs[k * columns + c] = quantum += steps[(c * count + i) * period + k];
    const bytesOf = (table) => new Uint8Array(table.buffer);
    return [stiffness, { ...same, start: starts[i], reference: bytesOf(reference), inputs: bytesOf(inputs) }];
  }));
}

/** What all legs share: the module, where its fields are, and the plans by stiffness. */
class LegModel {
  static async load(packed) {
    const model = new LegModel();
    model.packed = packed;
    model.module = await WebAssembly.compile(await inflate(packed.wasm));
    model.plans = unpackPlans(await inflate(packed.plans), packed);
    return model;
  }

  /** The settings of a leg and the number of cycles, as overrides of a run in Python. */
  static overrides({ stiffness, mass, delay, rate, lead, guard }, cycles) {
    return `scenario=one_leg reference=aware cycles=${cycles} terrain.stiffness=${stiffness} machine.leg.mass_1=${mass} ` +
      `machine.leg.mass_2=${mass} actuator.delay=${delay} learning.rate=${rate} learning.lead=${lead} ` +
      `learning.guard=${guard ? "freeze" : "none"}`;
  }

  /** The rate that acts: the guard limits it. */
  actingRate({ rate, delay, guard }) {
    return guard ? Math.min(rate, this.packed.guarded_rates[delay]) : rate;
  }

  /** A leg at the start of a run: mass of each link (kg), stiffness (N/m), delay and lead (samples), rate, guard; and
   * learns, false with feedback only. */
  async leg(settings) {
    const instance = await WebAssembly.instantiate(this.module, {});
    return new Leg(this, instance.exports, this.plans.get(settings.stiffness), settings);
  }
}

/** One run. Its memory: Law, State, the tables that Law points at, then samples. */
class Leg {
  constructor(model, wasm, plan, settings) {
    const { law, state, tables, law_bytes, state_bytes } = model.packed;
    this.offsets = state;
    this.wasm = wasm;
    this.lawAt = (wasm.__heap_base.value + 15) & ~15;
    this.stateAt = this.lawAt + law_bytes;
    let end = this.stateAt + state_bytes;
    const places = tables.map(([, , size]) => { const at = end; end += (size + 15) & ~15; return at; });
    this.samplesAt = end;
    this.mostSteps = 600;
    end += this.mostSteps * LEG_COLUMNS * 8;
    wasm.memory.grow(Math.ceil(end / PAGE_BYTES) - wasm.memory.buffer.byteLength / PAGE_BYTES);
    const memory = new Uint8Array(wasm.memory.buffer);
    this.view = new DataView(wasm.memory.buffer);
    memory.set(plan.start, this.lawAt);
    tables.forEach(([name, pointer], i) => {
      this.view.setUint32(this.lawAt + pointer, places[i], true);
      if (plan[name]) memory.set(plan[name], places[i]); // the others start at zero
    });
    const number = (name, value) => this.view.setFloat64(this.lawAt + law[name], value, true);
    const count = (name, value) => this.view.setBigInt64(this.lawAt + law[name], BigInt(value), true);
    this.rate = model.actingRate(settings);
    number("mass_1", settings.mass);
    number("mass_2", settings.mass);
    number("rate", this.rate);
    count("delay", settings.delay);
    count("lead", settings.lead);
    const learns = settings.learns !== false;
    count("guarded", settings.guard && learns ? 1 : 0);
    if (!learns) count("start_step", NEVER);
    this.taken = 0;
    this.diverged = false;
  }

  /** Take up to `steps` steps, at most a cycle; the samples, LEG_COLUMNS numbers of each step that was taken. */
  take(steps) {
    const asked = this.diverged ? 0 : Math.min(steps, this.mostSteps);
    const taken = Number(this.wasm.one_leg(this.lawAt, this.stateAt, BigInt(asked), this.samplesAt));
    this.taken += taken;
    const next = this._count("taken");
    this.diverged = this.diverged || next !== this.taken;
    return new Float64Array(this.wasm.memory.buffer.slice(this.samplesAt, this.samplesAt + taken * LEG_COLUMNS * 8));
  }

  _count(name) {
    return Number(this.view.getBigInt64(this.stateAt + this.offsets[name], true));
  }

  /** What the guard did last: phase, cause (0: nothing), step, and the cycle whose torque acts since (0: none). */
  guard() {
    return { phase: this._count("phase"), cause: this._count("cause"), step: this._count("acted"),
      restored: this._count("best_cycle") };
  }
}

Object.assign(globalThis, { LegModel, LEG_COLUMNS });
