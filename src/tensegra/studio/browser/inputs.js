// The inputs: a slider and a number field each. A drag is one gesture, so that it is taken back as one.

class Inputs {
  constructor(form, move) {
    this.form = form;
    this.move = move;
    this.gesture = 0;
    this.knobs = new Map();
    form.addEventListener("submit", (event) => event.preventDefault());
  }

  show(knobs, stands) {
    this.form.replaceChildren();
    this.knobs.clear();
    knobs.forEach((knob) => this.add(knob));
    const nothing = "Nothing of this structure is actuated, heated or loaded. Add a load, or edit it.";
    if (!stands) this.form.append(make("p", { textContent: "It cannot be moved before it stands." }));
    else if (!knobs.length) this.form.append(make("p", { textContent: nothing }));
  }

  add(knob) {
    let group = [...this.form.querySelectorAll("fieldset")].find((set) => set.dataset.name === knob.group);
    if (!group) {
      group = make("fieldset", { data: { name: knob.group } }, make("legend", { textContent: knob.group }));
      this.form.append(group);
    }
    const id = `knob-${this.knobs.size}`;
    const number = make("input", { type: "number", step: "any", value: round(knob.value), id });
    const slider = make("input", { type: "range", min: knob.low, max: knob.high, step: (knob.high - knob.low) / 1000, value: knob.value });
    slider.setAttribute("aria-label", `${knob.label}, slider`);
    slider.dataset.key = number.dataset.key = knob.key;
    const box = make("div", { className: "knob" }, make("label", { htmlFor: id, textContent: knob.label }), slider, number, make("span", { className: "unit", textContent: knob.unit }));
    group.append(box);
    const begin = () => { this.gesture += 1; };
    slider.addEventListener("pointerdown", begin);
    slider.addEventListener("keydown", (event) => { if (!event.repeat) begin(); });
    slider.addEventListener("input", () => {
      number.value = round(Number(slider.value));
      this.move({ [knob.key]: Number(slider.value) }, this.gesture);
    });
    number.addEventListener("change", () => {
      if (number.value === "" || !Number.isFinite(number.valueAsNumber)) { this.reflect(this.values); return; }
      begin();
      slider.value = number.value;
      this.move({ [knob.key]: number.valueAsNumber }, this.gesture);
    });
    slider.addEventListener("change", () => { this.settled = true; });
    this.knobs.set(knob.key, { slider, number, box });
  }

  // Show where the structure stands; a slider under the hand is left to it.
  reflect(values, moved = true) {
    this.values = values;
    for (const [key, { slider, number, box }] of this.knobs) {
      if (!(key in values)) continue;
      const held = slider.matches(":active") || document.activeElement === number;
      box.classList.toggle("refused", !moved && Number(number.value) !== round(values[key]));
      if (!held) {
        slider.value = values[key];
        if (moved) number.value = round(values[key]);
      }
    }
  }
}

function round(value) {
  return Number(value.toPrecision(7));
}
