// Where the structure stands, in words and numbers.

const SIGNS = { stable: "✓ stable", snapped: "⚠ snapped", collapsed: "✗ collapsed", unstable: "✗ unstable", failed: "✗ failed" };
const SHOWN = 6; // digits
const ROUNDING = 1e-12; // of the largest number of its kind: what is smaller is zero
let solvedIn = 0; // milliseconds of the last move

const quiet = (value, most) => (Math.abs(value) < ROUNDING * most ? 0 : value);

// Nothing is left of what was told of a structure that stood, where one does not stand.
function showFallen(fault) {
  byId("status-word").textContent = "✗ it does not stand";
  byId("status-word").className = "failed";
  byId("reason").textContent = fault;
  byId("displacement").textContent = "–";
  byId("facts").replaceChildren();
  byId("reactions").replaceChildren();
  delete byId("reactions").dataset.nodes;
  byId("undo").disabled = true;
}

function showState(state, units) {
  const word = byId("status-word");
  solvedIn = state.milliseconds || solvedIn;
  word.textContent = state.moved ? SIGNS[state.status] : `${SIGNS[state.status]}: it stays where it was`;
  word.className = state.status;
  byId("reason").textContent = state.reason;
  byId("displacement").textContent = `${digits(quiet(state.displacement, state.size), SHOWN)} ${units.length}`;
  const facts = {
    "lowest eigenvalue": state.lowest_eigenvalue === null ? "–" : `${digits(state.lowest_eigenvalue, 5)} ${units.force}/${units.length}`,
    "largest tension": `${state.largest_tension[0]}: ${digits(state.largest_tension[1], 5)} ${units.force}`,
    "slack cables": state.n_slack ? `${state.n_slack}: ${state.slack.join(", ")}` : "none",
    "rigid motions": state.rigid_motions.join(", ") || "none",
    "free mechanisms": state.mechanisms.length ? state.mechanisms.map((nodes) => nodes.join(" ")).join("; ") : "none",
    "residual": state.residual === null ? "–" : state.residual.toExponential(1),
    "strain energy": state.strain_energy === null ? "–" : `${digits(state.strain_energy, 5)} ${units.force} ${units.length}`,
    "solved in": solvedIn ? `${solvedIn.toFixed(2)} ms` : "–",
  };
  const list = byId("facts");
  if (list.children.length !== 2 * Object.keys(facts).length) {
    list.replaceChildren(...Object.keys(facts).flatMap((name) => [make("dt", { textContent: name }), make("dd")]));
  }
  Object.values(facts).forEach((text, i) => {
    const cell = list.children[2 * i + 1];
    if (cell.textContent !== text) cell.textContent = text;
  });
  showReactions(state.reactions, units, state.largest_force);
  byId("undo").disabled = state.undo === 0;
}

function showReactions(reactions, units, most) {
  const table = byId("reactions");
  const nodes = Object.keys(reactions);
  if (table.dataset.nodes !== nodes.join("\n")) {
    table.dataset.nodes = nodes.join("\n");
    const head = make("thead", {}, make("tr", {}, ...["node", "x", "y", "z"].map((text, i) => make("th", { scope: "col", textContent: i ? `${text}, ${units.force}` : text }))));
    const rows = nodes.map((node) => make("tr", {}, make("th", { scope: "row", textContent: node }), make("td"), make("td"), make("td")));
    table.replaceChildren(head, make("tbody", {}, ...rows));
  }
  nodes.forEach((node, i) => {
    reactions[node].forEach((value, axis) => { table.tBodies[0].rows[i].cells[axis + 1].textContent = digits(quiet(value, most), 4); });
  });
}

function tellFault(text) {
  const line = byId("fault");
  line.textContent = text;
  line.hidden = !text;
}
