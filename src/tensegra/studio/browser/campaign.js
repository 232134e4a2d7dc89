// What the campaign knows of the set-point: predictions beside the truth, the spread, a search.

class Campaign {
  constructor(element, talk) {
    Object.assign(this, { element, talk });
  }

  show(opened) {
    this.opened = opened;
    this.element.hidden = !opened.surrogates.length;
    if (this.element.hidden) return;
    const { surrogates, outputs, knobs } = opened;
    this.table = make("table");
    this.select = make("select", {}, ...surrogates.map((name) => make("option", { value: name, textContent: name })));
    this.output = make("select", {}, ...Object.keys(outputs).map((name) => make("option", { value: name, textContent: name })));
    this.output.value = Object.keys(outputs).at(-1);
    this.limit = make("input", { type: "number", step: "any", size: 8 });
    for (const [control, label] of [[this.select, "Surrogate"], [this.output, "Output"], [this.limit, "Limit"]]) control.setAttribute("aria-label", label);
    this.free = knobs.map((knob) => {
      const box = make("input", { type: "checkbox", value: knob.key, checked: knob.quantity !== "actuator" });
      return [box, make("label", {}, box, ` ${knob.key}`)];
    });
    this.chart = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    this.chart.setAttribute("class", "chart");
    this.chart.setAttribute("viewBox", "0 0 320 130");
    this.chart.setAttribute("role", "img");
    this.words = make("p");
    this.slopes = make("div", { className: "slopes" });
    this.optimum = make("div");
    const ask = (maximise) => {
      const search = this.free.filter(([box]) => !box.checked).map(([box]) => box.value);
      this.optimum.textContent = "searching…";
      this.talk.say({ type: "optimise", surrogate: this.select.value, output: this.output.value, maximise, search });
    };
    this.element.replaceChildren(
      make("h2", { textContent: "Predicted and true" }), make("div", { className: "scroll", tabIndex: 0 }, this.table),
      make("h2", { textContent: "Spread about the set-point" }),
      make("div", { className: "row" }, this.select, this.output, make("label", {}, "limit ", this.limit)),
      make("div", { className: "row" }, "by their laws:", ...this.free.map(([, label]) => label)),
      this.chart, this.words,
      make("h2", { textContent: "What it depends on" }), this.slopes,
      make("h2", { textContent: "Search the variables that are held" }),
      make("div", { className: "row" }, button("Smallest", "Search the smallest value of the output", () => ask(false)), button("Largest", "Search the largest value of the output", () => ask(true))),
      this.optimum,
    );
    for (const control of [this.select, this.output, this.limit, ...this.free.map(([box]) => box)]) control.addEventListener("change", () => this.refresh());
    this.asked = false;
  }

  state(state) {
    if (this.element.hidden || !state.predictions) return;
    const { outputs } = this.opened;
    const names = Object.keys(state.predictions);
    const cell = (found) => {
      if (!found) return "–";
      const [value, low, high] = found;
      return low === null ? digits(value, 5) : `${digits(value, 5)} ± ${digits((high - low) / 2, 2)}`;
    };
    const rows = Object.keys(outputs).map((name) => make("tr", {},
      make("th", { scope: "row", textContent: `${name}${outputs[name] ? `, ${outputs[name]}` : ""}` }),
      make("td", { textContent: digits(state.truth[name], SHOWN) }),
      ...names.map((surrogate) => make("td", { textContent: cell(state.predictions[surrogate].outputs[name]) }))));
    const notes = names.flatMap((name) => {
      const { outside, regimes } = state.predictions[name];
      const told = Object.entries(regimes).map(([regime, p]) => `${regime} ${digits(100 * p, 3)} %`);
      return [...(outside ? [`${name}: outside its training`] : []), ...(told.length ? [`${name}: ${told.join(", ")}`] : [])];
    });
    this.table.replaceChildren(
      make("caption", { textContent: notes.join("; ") }),
      make("thead", {}, make("tr", {}, ...["", "true", ...names].map((text) => make("th", { scope: "col", textContent: text })))),
      make("tbody", {}, ...rows),
    );
    this.refresh();
  }

  // One question at a time; what changed meanwhile is asked when the answer is there.
  refresh() {
    if (this.asked) { this.again = true; return; }
    this.asked = true;
    const limits = this.limit.value === "" ? {} : { [this.output.value]: this.limit.valueAsNumber };
    this.talk.say({ type: "spread", surrogate: this.select.value, free: this.free.filter(([box]) => box.checked).map(([box]) => box.value), limits });
  }

  answered() {
    this.asked = false;
    if (this.again) { this.again = false; this.refresh(); }
  }

  spread({ outputs }) {
    this.answered();
    const found = outputs[this.output.value];
    if (!found) return;
    const unit = this.opened.outputs[this.output.value];
    this.draw(found, unit);
    const largest = Math.max(...Object.values(found.slopes).map(Math.abs), 1e-300);
    this.slopes.replaceChildren(...Object.entries(found.slopes).flatMap(([name, slope]) => {
      const bar = make("meter", { min: 0, max: largest, value: Math.abs(slope) });
      bar.setAttribute("aria-label", `${name}: ${digits(slope, 3)} ${unit}`);
      return [make("span", { textContent: name }), bar, make("span", { textContent: `${digits(slope, 3)} ${unit}` })];
    }));
  }

  draw(found, unit) {
    if (!found.counts) { this.words.textContent = "No equilibrium is predicted there."; this.chart.replaceChildren(); return; }
    const most = Math.max(...found.counts);
    const width = 300 / found.counts.length;
    const shape = (tag, attributes) => {
      const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
      for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
      return element;
    };
    const x = (value) => 10 + (300 * (value - found.low)) / (found.high - found.low || 1);
    const text = (value, anchor, place) => Object.assign(shape("text", { x: place, y: 126, "text-anchor": anchor }), { textContent: digits(value, 4) });
    const bars = found.counts.map((count, i) => shape("rect", { class: "bar", x: 10 + i * width, y: 110 - (100 * count) / most, width: Math.max(width - 0.6, 0.5), height: (100 * count) / most }));
    const limit = this.limit.value === "" ? null : this.limit.valueAsNumber;
    const marks = limit !== null && limit >= found.low && limit <= found.high ? [shape("line", { class: "mark", x1: x(limit), x2: x(limit), y1: 5, y2: 110 })] : [];
    this.chart.replaceChildren(...bars, shape("line", { class: "edge", x1: 10, x2: 310, y1: 110, y2: 110 }), ...marks, text(found.low, "start", 10), text(found.high, "end", 310));
    const [p5, p50, p95] = found.percentiles.map((value) => digits(value, 5));
    const exceeds = found.exceedance === null ? "" : ` · above the limit ${digits(100 * found.exceedance, 3)} %`;
    this.words.textContent = `mean ${digits(found.mean, 5)} ${unit} · 5 % ${p5} · 50 % ${p50} · 95 % ${p95}${exceeds}`;
    this.chart.setAttribute("aria-label", this.words.textContent);
  }

  found(optimum, jump) {
    const unit = this.opened.outputs[this.output.value];
    const text = `${optimum.reason}. Predicted ${digits(optimum.objective, 6)} ${unit}, true ${optimum.true_objective === null ? "–" : digits(optimum.true_objective, 6)} ${unit} (${optimum.true_status}); ${optimum.evaluations} evaluations in ${digits(optimum.seconds, 2)} s.`;
    this.optimum.replaceChildren(
      make("p", { textContent: text }),
      button("Go there", "Move the structure to the optimum", () => jump(optimum.inputs)),
      make("details", {}, make("summary", { textContent: "The entry of a study that asks the same" }), make("pre", { textContent: optimum.entry })),
    );
  }
}
