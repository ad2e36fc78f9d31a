// Moves the bodies and the marks in the charts along the insertion, and chooses what the colours show. Without it the page
// shows the displacement at the end.
(() => {
  const { number, tip } = common;
  const data = JSON.parse(document.getElementById("insertion-data").textContent);
  const slider = document.getElementById("depth-slider");
  const reading = document.getElementById("depth-reading");
  const cases = [...document.querySelectorAll("[data-case]")];
  if (!data || !slider) return;
  for (const part of document.querySelectorAll(".needs-script")) part.classList.remove("needs-script");

  // Linear between the neighbours of `depth` in rows whose depth is `key(row)`; f is the part of the way.
  const between = (rows, key, depth) => {
    let i = rows.findIndex((row) => key(row) >= depth);
    if (i < 0) i = rows.length - 1;
    if (i === 0) return [rows[0], rows[0], 0];
    const [low, high] = [key(rows[i - 1]), key(rows[i])];
    return [rows[i - 1], rows[i], high > low ? Math.min(1, (depth - low) / (high - low)) : 1];
  };
  const mix = (a, b, f) => a + (b - a) * f;
  const at = (rows, depth, end) => {
    const last = rows[rows.length - 1];
    if (end || rows.length === 1) return last;
    const [a, b, f] = between(rows, (row) => row[0], depth);
    return a.map((value, i) => mix(value, b[i], f));
  };
  const bodies = data.bodies.map((body) => {
    const svg = document.getElementById(body.id);
    return { ...body, svg, polygons: [...svg.querySelectorAll(".field polygon")], edge: svg.querySelector(".edge"),
      lumps: [...svg.querySelectorAll(".lump")],
      aim: svg.querySelector(".aim"), tool: svg.querySelector(".tool"), shaft: svg.querySelector(".shaft"),
      part: svg.closest("[data-case]"), values: [],
      numbers: document.getElementById(body.id + "-numbers"), final: body.series[body.series.length - 1] };
  });
  const charts = data.charts.map(([id, span]) => ({ cursor: document.querySelector("#" + id + " .cursor"), span }));
  const place = ([x, y]) => x.toFixed(1) + "," + y.toFixed(1);
  const shift = (group, [x, y]) => group && group.setAttribute("transform", `translate(${(x * data.scale).toFixed(2)},${(-y * data.scale).toFixed(2)})`);

  // The state between two solved ones: nodes in px, and the fields that were solved for.
  const stateAt = (frames, depth, end) => {
    const last = frames[frames.length - 1];
    const [a, b, f] = end ? [last, last, 0] : between(frames, (frame) => frame.depth, depth);
    const value = (list, i) => list.length ? list[i] : 0;
    const mixed = (key) => data.rest.map((_, i) => mix(value(a[key], i), value(b[key], i), f));
    return { nodes: a.nodes.map((node, i) => [mix(node[0], b.nodes[i][0], f), mix(node[1], b.nodes[i][1], f)]), mixed };
  };
  const moved = (nodes) => nodes.map((node, i) => [(node[0] - data.rest[i][0]) / data.scale, (data.rest[i][1] - node[1]) / data.scale]);
  const valuesOf = (state, key) => {
    if (key === "size") return moved(state.nodes).map(([x, y]) => Math.hypot(x, y));
    if (key === "orthogonal") return moved(state.nodes).map(([x, y]) => Math.abs(x * data.normal[0] + y * data.normal[1]));
    return state.mixed(key);
  };
  const inTriangles = (values) => data.triangles.map((corners) => corners.reduce((sum, corner) => sum + values[corner], 0) / 3);
  // Triangles that reach into the window at rest.
  const near = data.triangles.map((corners) => corners.some((corner) => {
    const [x, y] = data.rest[corner], [left, top, width, height] = data.window;
    return x >= left && x <= left + width && y >= top && y <= top + height;
  }));
  const field = document.getElementById("field"), part = document.getElementById("part");
  const bar = document.querySelector(".colours svg");
  let largest = 1;
  // One scale for all strategies of a case and all depths, so that colours can be compared along both.
  const scale = (chosen, onlyNear) => {
    let beyond = false;
    largest = Number.MIN_VALUE;
    for (const body of bodies) {
      if (body.part.hidden) continue;
      for (const frame of body.frames) {
        const values = inTriangles(valuesOf(stateAt([frame], frame.depth, true), chosen.key));
        const shown = values.filter((value, i) => Number.isFinite(value) && (!onlyNear || near[i])).sort((a, b) => a - b);
        if (shown.length === 0) continue;
        const within = Math.ceil(shown.length * (1 - (onlyNear ? 0 : chosen.beyond)));
        largest = Math.max(largest, shown[within - 1]);
        beyond = beyond || within < shown.length;
      }
    }
    const [low, middle, high] = bar.querySelectorAll("text.tick");
    const label = bar.querySelector("text.muted");
    low.textContent = "0"; middle.textContent = number(largest / 2);
    high.textContent = number(largest) + (beyond ? " and more" : "");
    label.textContent = chosen.label;
  };

  const show = (depth) => {
    const end = depth >= data.depth * (1 - 1e-9);
    reading.textContent = number(depth) + (end ? " (end)" : "");
    for (const body of bodies) {
      const now = at(body.series, depth, end);
      body.numbers.textContent = `orthogonal error ${number(now[1])}${data.unit}` +
        (body.tool ? `, paddle moved (${number(now[3])}, ${number(now[4])})${data.unit}` : "");
      const along = (row) => [0, 1].map((i) => data.axis[i] * row[2] + data.normal[i] * row[1]);
      const [here, there] = [along(now), along(body.final)];
      shift(body.aim, [here[0] - there[0], here[1] - there[1]]);
      shift(body.tool, [now[3] - body.final[3], now[4] - body.final[4]]);
      shift(body.shaft, data.axis.map((part) => part * (depth - data.depth)));
      if (body.frames.length < 2) continue;
      const state = stateAt(body.frames, depth, end);
      body.values = inTriangles(valuesOf(state, field.value));
      data.triangles.forEach((corners, i) => {
        const band = Math.min(data.bands - 1, Math.floor(body.values[i] / largest * data.bands));
        const polygon = body.polygons[i];
        if (!polygon) return;
        polygon.setAttribute("points", corners.map((corner) => place(state.nodes[corner])).join(" "));
        polygon.setAttribute("class", "f" + band);
      });
      body.lumps.forEach((lump, i) => lump.setAttribute("points", data.inclusions[i].map(({ corners, weights }) =>
        place([0, 1].map((k) => corners.reduce((sum, corner, c) => sum + weights[c] * state.nodes[corner][k], 0)))).join(" ")));
      if (body.edge) body.edge.setAttribute("points", data.boundary.map((i) => place(state.nodes[i])).join(" "));
    }
    for (const { cursor, span: [left, right, low, high] } of charts) {
      const x = mix(left, right, (depth - low) / (high - low));
      cursor.setAttribute("x1", x);
      cursor.setAttribute("x2", x);
      cursor.style.visibility = "visible";
    }
  };
  const move = () => show(data.depth * slider.value / slider.max);
  const redraw = () => {
    const chosen = data.fields.find((one) => one.key === field.value) || data.fields[0];
    const zoomed = part.value === "near";
    for (const body of bodies) {
      body.svg.setAttribute("viewBox", (zoomed ? data.window : [0, 0, ...data.size]).map((px) => px.toFixed(1)).join(" "));
      body.svg.classList.toggle("zoomed", zoomed);
    }
    scale(chosen, zoomed);
    move();
  };
  const choose = (chosen) => { for (const one of cases) one.hidden = one.dataset.case !== chosen; };
  for (const radio of document.querySelectorAll("input[name=case]")) {
    radio.addEventListener("change", () => { choose(radio.value); redraw(); });
    if (radio.checked) choose(radio.value);
  }
  for (const select of [field, part]) select.addEventListener("change", redraw);
  slider.addEventListener("input", move);
  redraw();

  for (const body of bodies) {
    const chosen = () => data.fields.find((one) => one.key === field.value) || data.fields[0];
    body.polygons.forEach((polygon, i) => polygon.addEventListener("pointermove", (event) =>
      tip.show(event, [`${chosen().label}: ${number(body.values[i])}`])));
    body.svg.addEventListener("pointerleave", tip.hide);
  }
  // On paper every case is there, as the page was before its script: whole, at the end.
  addEventListener("beforeprint", () => {
    for (const one of cases) one.hidden = false;
    [slider.value, field.value, part.value] = [slider.max, "size", "whole"];
    redraw();
  });
})();
