// Controls, colour bar, tables; begins when everything else is there.
(() => {
  "use strict";
  const { content, scalar, extremes, ticks, said, colourMaps, SheetView, Curves, viewNames } = window.page;
  const { frames, summary, choices } = content;
  const SECONDS_OF_A_RUN = 8;
  const DAMAGE = "inferno_r", ONE_SIGN = "viridis", BOTH_SIGNS = "coolwarm";
  const MAP_WORDS = { inferno_r: "inferno", coolwarm: "cool and warm" };
  const get = (id) => document.getElementById(id);
  const state = { frame: 0, scalar: null, numbers: null, playing: null, graphs: [] };
  window.page.state = state;

  const unitOf = ({ unit }) => (unit ? ` (${unit})` : "");
  const choice = () => choices[get("field").value];

  function row(table, cells, head = false) {
    const line = table.insertRow();
    for (const [text, kind] of cells) {
      const cell = head ? line.appendChild(document.createElement("th")) : line.insertCell();
      cell.textContent = text;
      if (kind) cell.className = kind;
    }
    return line;
  }

  function plain(value) {
    if (typeof value === "number") return said(value, 6);
    return value === null ? "none" : typeof value === "object" ? JSON.stringify(value) : String(value);
  }

  function fillTables() {
    get("title").textContent = content.title.replaceAll("_", " ");
    document.title = content.title;
    const status = summary.status || "no summary";
    const facts = [summary.section, status, summary.material, summary.points && `${summary.points} points`,
      summary.date && summary.date.slice(0, 10), summary.version && `warp-pd ${summary.version}`];
    get("facts").textContent = facts.filter(Boolean).join("  \u00b7  ");
    fillMeasures(summary.measures || {});
    for (const note of [summary.message, ...(summary.notes || [])].filter(Boolean)) {
      get("notes").appendChild(document.createElement("p")).textContent = note;
    }
    for (const [name, value] of Object.entries(summary.settings || {})) {
      row(get("settings"), [[name.replaceAll("_", " ")], [plain(value), "number"]]);
    }
    const apart = ["scene", "section", "status", "message", "settings", "notes", "measures", "pictures", "energy"];
    for (const [name, value] of Object.entries(summary)) {
      if (!apart.includes(name)) row(get("about"), [[name.replaceAll("_", " ")], [plain(value)]]);
    }
    for (const id of ["settings", "about"]) get(id).parentElement.hidden = !get(id).rows.length;
    for (const line of content.leftOut) get("left-out").appendChild(document.createElement("li")).textContent = line;
  }

  function fillMeasures(measures) {
    const table = get("measures"), found = Object.entries(measures);
    table.previousElementSibling.hidden = !found.length;
    if (!found.length) return;
    const compared = found.some(([, { reference }]) => reference !== null);
    row(table.createTHead(), compared ? [[""], ["value", "number"], ["reference", "number"], ["error", "number"]] : [[""], ["value", "number"]], true);
    const body = table.createTBody();
    for (const [name, { value, unit, of, reference, source, error }] of found) {
      const units = unit === "1" || unit === "-" ? "" : ` ${unit}`;
      const cells = [[name.replaceAll("_", " ")], [value === null ? "none" : said(value, 5) + units, "number"]];
      if (compared && reference !== null) {
        cells.push([said(reference, 5) + units, "number"], [error === null ? "" : `${said(100 * error, 3)} %`, "number"]);
      } else if (compared) cells.push([""], [""]);
      const line = row(body, cells);
      const under = line.cells[0].appendChild(document.createElement("div"));
      under.className = "source";
      under.textContent = [of, reference !== null && source].filter(Boolean).join("; ");
    }
  }

  function drawBar(low, high) {
    const context = get("bar").querySelector("canvas").getContext("2d"), text = colourMaps[get("map").value];
    for (let k = 0; k < 256; k++) {
      context.fillStyle = `#${text.slice(6 * k, 6 * k + 6)}`;
      context.fillRect(0, 255 - k, 1, 1);
    }
    get("bar-title").textContent = choice().label + unitOf(choice());
    get("bar-ticks").textContent = "";
    for (const tick of ticks(low, high, 5)) {
      const mark = get("bar-ticks").appendChild(document.createElement("span"));
      mark.style.bottom = `${high > low ? (100 * (tick - low)) / (high - low) : 0}%`;
      mark.textContent = said(tick);
    }
  }

  // Limits of the colours; a signed field has zero in the middle of a map of two colours.
  function limits() {
    if (get("range").value === "own") return [Number(get("low").value), Number(get("high").value)];
    if (get("range").value === "frame") return balanced(...extremes(state.numbers));
    if (get("range").value === "most") return balanced(...mostOf(state.scalar));
    return choice().field === "damage" ? [0, 1] : balanced(state.scalar.low, state.scalar.high);
  }

  // Limits between which 98 % of the numbers of some frames are: a peak at the tip of a crack does not darken the rest.
  function mostOf(found) {
    if (!found.most) {
      const room = new Float32Array(state.view.points), every = Math.ceil(frames.length / 12), numbers = [];
      const apart = Math.ceil(room.length / 10000);
      for (let frame = frames.length - 1; frame >= 0; frame -= every) {
        found.fill(frame, room);
        for (let k = 0; k < room.length; k += apart) if (!Number.isNaN(room[k])) numbers.push(room[k]);
      }
      numbers.sort((a, b) => a - b);
      const at = (fraction) => numbers[Math.round(fraction * (numbers.length - 1))] ?? 0;
      found.most = [at(0.01), at(0.99)];
    }
    return found.most;
  }

  function balanced(low, high) {
    // Round-off is not shown as a limit.
    if (Math.abs(low) < 1e-9 * Math.abs(high)) low = 0;
    if (Math.abs(high) < 1e-9 * Math.abs(low)) high = 0;
    if (get("map").value !== BOTH_SIGNS) return [low, high];
    const most = Math.max(Math.abs(low), Math.abs(high));
    return [-most, most];
  }

  function colour() {
    state.scalar.fill(state.frame, state.numbers);
    const [low, high] = limits();
    if (get("range").value !== "own") [get("low").value, get("high").value] = [low, high].map((n) => Number(n.toPrecision(4)));
    state.view.paint(state.numbers, low, high);
    drawBar(low, high);
  }

  function show(frame) {
    state.frame = Math.max(0, Math.min(frames.length - 1, frame));
    get("frame").value = state.frame;
    get("frame-number").textContent = `${state.frame + 1} of ${frames.length}`;
    get("when").textContent = frames[state.frame].when;
    state.view.show(state.frame);
    colour();
    state.view.draw();
    for (const graph of state.graphs) graph.show(frames[state.frame].time);
    document.body.dataset.frame = state.frame;
    document.body.dataset.triangles = state.view.drawnTriangles;
  }

  async function chooseField() {
    const wanted = choice();
    const found = await scalar(wanted);
    if (wanted !== choice()) return;
    state.scalar = found;
    state.numbers = new Float32Array(state.view.points);
    const signed = found.low < -0.02 * Math.abs(found.high) && found.high > 0.02 * Math.abs(found.low);
    get("map").value = wanted.field === "damage" ? DAMAGE : signed ? BOTH_SIGNS : ONE_SIGN;
    get("range").value = "run";
    state.view.set("colours", get("map").value);
    show(state.frame);
    document.body.dataset.field = wanted.label;
  }

  function ownLimits() {
    const inputs = [get("low"), get("high")];
    const numbers = inputs.map(({ value }) => (value.trim() ? Number(value) : NaN));
    const right = numbers.every(Number.isFinite) && numbers[0] < numbers[1];
    inputs.forEach((input) => input.classList.toggle("wrong", !right));
    if (!right) return;
    get("range").value = "own";
    show(state.frame);
  }

  function play() {
    if (state.playing !== null) return pause();
    if (state.frame === frames.length - 1) show(0);
    let last = performance.now(), passed = 0;
    get("run").innerHTML = "&#10073;&#10073;";
    const step = (now) => {
      const seconds = Math.min(SECONDS_OF_A_RUN / frames.length, 0.5) / Number(get("speed").value);
      passed += (now - last) / 1000;
      last = now;
      const steps = Math.floor(passed / seconds);
      passed -= steps * seconds;
      if (steps) show(state.frame + steps);
      if (state.frame >= frames.length - 1) return pause();
      state.playing = requestAnimationFrame(step);
    };
    state.playing = requestAnimationFrame(step);
  }

  function pause() {
    cancelAnimationFrame(state.playing);
    state.playing = null;
    get("run").innerHTML = "&#9654;";
  }

  function seek(time) {
    if (!state.view) return;
    let nearest = 0;
    frames.forEach((frame, k) => { if (Math.abs(frame.time - time) < Math.abs(frames[nearest].time - time)) nearest = k; });
    pause();
    show(nearest);
  }

  // The picture with its bar, as a file.
  function save() {
    const source = get("canvas"), ratio = source.width / source.clientWidth;
    const copy = Object.assign(document.createElement("canvas"), { width: source.width, height: source.height });
    const context = copy.getContext("2d");
    context.fillStyle = "#fff";
    context.fillRect(0, 0, copy.width, copy.height);
    context.drawImage(source, 0, 0);
    context.scale(ratio, ratio);
    context.font = "14px system-ui, sans-serif";
    context.fillStyle = "#1d2429";
    const stage = get("stage").getBoundingClientRect();
    const at = (element) => {
      const box = element.getBoundingClientRect();
      return [box.left - stage.left, box.top - stage.top, box.width, box.height];
    };
    context.drawImage(get("bar").querySelector("canvas"), ...at(get("bar").querySelector("canvas")));
    context.textBaseline = "middle";
    for (const element of [get("when"), ...get("bar-ticks").children, get("scale").firstElementChild]) {
      const [x, y, , height] = at(element);
      context.fillText(element.textContent, x, y + 0.5 * height);
    }
    context.textAlign = "right";
    const [x, y, width] = at(get("bar-title"));
    context.fillText(get("bar-title").textContent, x + width, y + 8);
    context.fillRect(...at(get("scale").lastElementChild).map((n, k) => (k === 3 ? 2 : n)));
    const link = document.createElement("a");
    link.download = `${content.title}-${state.frame}.png`;
    link.href = copy.toDataURL("image/png");
    link.click();
  }

  function connect() {
    choices.forEach(({ label, unit }, k) => get("field").add(new Option(label + unitOf({ unit }), k)));
    Object.keys(colourMaps).forEach((name) => get("map").add(new Option(MAP_WORDS[name] || name, name)));
    const first = choices.findIndex(({ field }) => field === "damage");
    get("field").value = first < 0 ? 0 : first;
    get("frame").max = frames.length - 1;
    get("frame").oninput = () => { pause(); show(Number(get("frame").value)); };
    get("run").onclick = play;
    get("field").onchange = chooseField;
    get("map").onchange = () => { state.view.set("colours", get("map").value); show(state.frame); };
    get("range").onchange = () => show(state.frame);
    for (const id of ["low", "high"]) get(id).onchange = ownLimits;
    get("grow").onchange = () => { state.view.set("grow", Number(get("grow").value) || 0); state.view.look(state.view.view); };
    get("grid").onchange = () => state.view.set("grid", get("grid").checked ? state.view.cell : 0);
    get("shade").onchange = () => state.view.set("shade", get("shade").checked ? 1 : 0);
    get("with-bodies").hidden = !content.bodies.length;
    get("bodies").onchange = () => state.view.showBodies(get("bodies").checked);
    get("save").onclick = save;
    for (const name of viewNames) {
      const button = get("views").appendChild(document.createElement("button"));
      button.textContent = name;
      button.onclick = () => state.view.look(name);
    }
    const fit = get("views").appendChild(document.createElement("button"));
    Object.assign(fit, { textContent: "fit", title: "Fit the view to what this frame shows" });
    fit.onclick = () => state.view.look(state.view.view, true);
    document.addEventListener("keydown", (event) => {
      if (["INPUT", "SELECT", "BUTTON", "SUMMARY"].includes(event.target.tagName)) return;
      if (event.key === " ") { event.preventDefault(); play(); }
      if (event.key === "ArrowRight" || event.key === "ArrowLeft") { pause(); show(state.frame + (event.key === "ArrowRight" ? 1 : -1)); }
    });
  }

  function buildGraphs() {
    const rooms = [...document.querySelectorAll(".graph")], graphs = content.history.graphs;
    rooms.slice(graphs.length).forEach((room) => room.remove());
    const energies = Math.max(graphs.findIndex(({ label }) => label === "energies"), Math.min(1, graphs.length - 1));
    state.graphs = rooms.slice(0, graphs.length).map((room, k) => new Curves(room, k ? energies : 0, seek));
  }

  async function begin() {
    fillTables();
    buildGraphs();
    state.view = await SheetView.create(get("canvas"));
    connect();
    await chooseField();
    // A flat sheet that stays flat is seen from above, unless a body is above it.
    if (state.view.flat && !content.bodies.length) state.view.look("top");
    document.body.dataset.ready = "yes";
  }

  begin().catch((error) => {
    get("trouble").hidden = false;
    get("trouble").textContent = `The sheet cannot be drawn: ${error.message}`;
    console.error(error);
  });
})();
