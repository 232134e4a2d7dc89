// Changes to the structure by hand, and whether it stands after them.

class Editing {
  constructor(element, talk) {
    this.talk = talk;
    this.body = make("div");
    element.append(this.body);
  }

  show(opened, viewer) {
    const nodes = Object.keys(opened.drawing);
    const members = Object.keys(opened.members);
    const choose = (name, list, label) => {
      const select = make("select", { name }, ...list.map((text) => make("option", { textContent: text })));
      select.setAttribute("aria-label", label);
      return select;
    };
    const field = (name, label, value, type = "number") => {
      const input = make("input", { name, type, value, size: 7, ...(type === "number" ? { step: "any" } : {}) });
      input.setAttribute("aria-label", label);
      input.title = label;
      if (type === "text") input.placeholder = name;
      input.style.width = "5.6rem";
      return input;
    };
    const form = (title, verb, parts, read) => {
      const made = make("form", { className: "row", autocomplete: "off" }, make("strong", { textContent: title }), ...parts, make("button", { type: "submit", textContent: verb }));
      made.addEventListener("submit", (event) => {
        event.preventDefault();
        const values = Object.fromEntries(new FormData(made));
        const [change, given] = read(values);
        this.talk.say({ type: "edit", change, given });
      });
      return made;
    };
    const place = ["x", "y", "z"].map((axis, k) => field(axis, `${axis} of the node`, opened.drawing[nodes[0]][k]));
    const where = choose("node", nodes, "Node to move");
    where.onchange = () => place.forEach((input, k) => { input.value = opened.drawing[where.value][k]; });
    const xyz = (values) => [Number(values.x), Number(values.y), Number(values.z)];
    const list = (text) => text.split(/[\s,]+/).filter(Boolean);
    this.verdict = make("p", { role: "status", textContent: "" });
    const quantity = choose("quantity", ["area", "rest_length", "stiffness"], "Quantity");
    const which = choose("member", members, "Member to change");
    const size = field("value", "Value", "");
    const renew = () => { size.value = opened.members[which.value][quantity.value] ?? ""; };
    quantity.onchange = which.onchange = renew;
    renew();
    const undo = button("Undo the change", "Take the last change back", () => this.talk.say({ type: "unedit" }));
    undo.disabled = !opened.edited;
    this.body.replaceChildren(
      this.verdict,
      form("Node", "Move", [where, ...place], (v) => ["move_node", { node: v.node, position: xyz(v) }]),
      form("Member", "Set", [which, quantity, size], (v) => ["set_member", { member: v.member, quantity: v.quantity, value: Number(v.value) }]),
      form("Member", "Remove", [choose("member", members, "Member to remove")], (v) => ["remove_member", { member: v.member }]),
      form("New member", "Add", [field("member", "Name", "", "text"), choose("kind", ["cable", "strut"], "Kind"), field("nodes", "Nodes in order", "", "text"), make("span", { textContent: "like" }), choose("like", members, "Material and area of"), make("span", { textContent: "prestrain" }), field("strain", "Prestrain", 0)],
        (v) => ["add_member", { member: v.member, kind: v.kind, nodes: list(v.nodes), like: v.like, strain: Number(v.strain) }]),
      form("New node", "Add", [field("node", "Name", "", "text"), ...["x", "y", "z"].map((axis) => field(axis, `${axis} of the new node`, 0)), make("span", { textContent: "joined to" }), field("to", "Nodes that it is joined to", "", "text"), choose("kind", ["cable", "strut"], "By"), make("span", { textContent: "like" }), choose("like", members, "Like")],
        (v) => ["add_node", { node: v.node, position: xyz(v), to: list(v.to), kind: v.kind, like: v.like }]),
      form("Support", "Set", [choose("node", nodes, "Node to support"), field("axes", "Axes, such as xyz; none for free", "xyz", "text")], (v) => ["set_support", { node: v.node, axes: v.axes }]),
      undo,
    );
    if (viewer && this.open) this.ask();
  }

  ask() {
    this.verdict.textContent = "…";
    this.talk.say({ type: "verdict" });
  }

  tell(found) {
    const counts = found.self_stress === null ? "" : ` States of self-stress: ${found.self_stress}; mechanisms: ${found.mechanisms}.`;
    this.verdict.textContent = `${found.stands ? "✓" : "✗"} ${found.verdict}.${counts} ${found.warnings.join(". ")}`;
  }
}
