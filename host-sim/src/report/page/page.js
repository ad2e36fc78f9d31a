"use strict";
// Moves the bodies and the marks in the charts along the insertion. Without it the page shows the end.
(() => {
  const data = JSON.parse(document.getElementById("insertion-data").textContent);
  const slider = document.getElementById("depth-slider");
  const reading = document.getElementById("depth-reading");
  const cases = [...document.querySelectorAll("[data-case]")];
  if (!data || !slider) return;
  for (const part of document.querySelectorAll(".needs-script")) part.classList.remove("needs-script");

  const superscript = (power) => [...String(power)].map((c) => c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[c]).join("");
  const number = (value) => {
    if (value === null || !Number.isFinite(value)) return "–";
    if (value === 0) return "0";
    const power = Math.floor(Math.log10(Math.abs(value)));
    const text = power < -4 || power > 5 ? (value / 10 ** power).toFixed(2) + "\u00a0×\u00a010" + superscript(power)
      : value.toFixed(Math.max(0, 2 - power));
    return text.replace("-", "−");
  };
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
    return { ...body, polygons: [...svg.querySelectorAll(".field polygon")], edge: svg.querySelector(".edge"),
      aim: svg.querySelector(".aim"), tool: svg.querySelector(".tool"), shaft: svg.querySelector(".shaft"),
      numbers: document.getElementById(body.id + "-numbers"), final: body.series[body.series.length - 1] };
  });
  const charts = data.charts.map(([id, span]) => ({ cursor: document.querySelector("#" + id + " .cursor"), span }));
  const place = ([x, y]) => x.toFixed(1) + "," + y.toFixed(1);
  const shift = (group, [x, y]) => group && group.setAttribute("transform", `translate(${(x * data.scale).toFixed(2)},${(-y * data.scale).toFixed(2)})`);

  const show = (depth) => {
    const end = depth >= data.depth * (1 - 1e-9);
    reading.textContent = number(depth) + (end ? " (end)" : "");
    for (const body of bodies) {
      const now = at(body.series, depth, end);
      body.numbers.textContent = `orthogonal error ${number(now[1])}` +
        (body.tool ? `, paddle moved (${number(now[3])}, ${number(now[4])})` : "");
      const along = (row) => [0, 1].map((i) => data.axis[i] * row[2] + data.normal[i] * row[1]);
      const [here, there] = [along(now), along(body.final)];
      shift(body.aim, [here[0] - there[0], here[1] - there[1]]);
      shift(body.tool, [now[3] - body.final[3], now[4] - body.final[4]]);
      shift(body.shaft, data.axis.map((part) => part * (depth - data.depth)));
      const frames = body.frames;
      if (frames.length < 2) continue;
      const [a, b, f] = end ? [frames[frames.length - 1], frames[frames.length - 1], 0] : between(frames, (frame) => frame.depth, depth);
      const nodes = a.nodes.map((node, i) => [mix(node[0], b.nodes[i][0], f), mix(node[1], b.nodes[i][1], f)]);
      const size = nodes.map((node, i) => Math.hypot(node[0] - data.rest[i][0], node[1] - data.rest[i][1]));
      data.triangles.forEach((corners, i) => {
        const mean = (size[corners[0]] + size[corners[1]] + size[corners[2]]) / 3;
        const band = Math.min(data.bands - 1, Math.floor(mean / data.largest * data.bands));
        const polygon = body.polygons[i];
        if (!polygon) return;
        polygon.setAttribute("points", corners.map((corner) => place(nodes[corner])).join(" "));
        polygon.setAttribute("class", "f" + band);
      });
      if (body.edge) body.edge.setAttribute("points", data.boundary.map((i) => place(nodes[i])).join(" "));
    }
    for (const { cursor, span: [left, right, low, high] } of charts) {
      const x = mix(left, right, (depth - low) / (high - low));
      cursor.setAttribute("x1", x);
      cursor.setAttribute("x2", x);
      cursor.style.visibility = "visible";
    }
  };
  const choose = (chosen) => { for (const part of cases) part.hidden = part.dataset.case !== chosen; };
  for (const radio of document.querySelectorAll("input[name=case]")) {
    radio.addEventListener("change", () => choose(radio.value));
    if (radio.checked) choose(radio.value);
  }
  const move = () => show(data.depth * slider.value / slider.max);
  slider.addEventListener("input", move);
  move();
})();
