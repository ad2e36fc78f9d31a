// What curves are worth under the pointer, and every picture as a file.
(() => {
  const { number, tip } = common;
  const span = (text) => { const [low, high, kind] = text.split(" "); return { low: +low, high: +high, log: kind === "log" }; };
  const value = ({ low, high, log }, part) => log ? low * (high / low) ** part : low + (high - low) * part;
  const corners = (line) => line.getAttribute("points").trim().split(/[ ,]+/).map(Number);
  // The vertex of a curve nearest to a place, sideways first: curves are read at an abscissa.
  const nearest = (line, x, y) => {
    const numbers = corners(line);
    let best = null;
    for (let i = 0; i + 1 < numbers.length; i += 2) {
      const off = Math.abs(numbers[i] - x) + 0.01 * Math.abs(numbers[i + 1] - y);
      if (!best || off < best.off) best = { off, at: [numbers[i], numbers[i + 1]] };
    }
    return best;
  };
  for (const frame of document.querySelectorAll("svg.chart rect.frame")) {
    const svg = frame.ownerSVGElement;
    const [left, top, width, height] = ["x", "y", "width", "height"].map((name) => +frame.getAttribute(name));
    const [xs, ys] = [span(frame.dataset.x), span(frame.dataset.y)];
    const read = (event) => {
      const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      if (x < left || x > left + width || y < top || y > top + height) return tip.hide();
      const found = new Map();
      for (const line of frame.parentNode.querySelectorAll("polyline[data-name]")) {
        const one = nearest(line, x, y);
        const before = found.get(line.dataset.name);
        if (one && one.off < 8 && !(before && before.off <= one.off)) found.set(line.dataset.name, one);
      }
      if (found.size === 0) return tip.hide();
      const unit = (text) => text ? " " + text : "";
      const lines = [`${frame.dataset.xName} ${number(value(xs, (x - left) / width))}${unit(frame.dataset.xUnit)}`];
      for (const [name, { at }] of found) {
        lines.push(`${name}: ${number(value(ys, 1 - (at[1] - top) / height))}${unit(frame.dataset.yUnit)}`);
      }
      tip.show(event, lines);
    };
    svg.addEventListener("pointermove", read);
    svg.addEventListener("pointerleave", tip.hide);
  }

  // A picture on a white ground with its style in it, as the page shows it now.
  const style = document.querySelector("style").textContent.replace(/@media screen[^{]*\{:root\{[^}]*\}\}/, "");
  const picture = (svg) => {
    const copy = svg.cloneNode(true);
    const [left, top, width, height] = svg.getAttribute("viewBox").split(" ").map(Number);
    for (const [name, text] of [["xmlns", svg.namespaceURI], ["width", width], ["height", height]]) copy.setAttribute(name, text);
    const make = (tag, attributes, text) => {
      const made = document.createElementNS(svg.namespaceURI, tag);
      for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
      if (text) made.textContent = text;
      return made;
    };
    copy.prepend(make("style", {}, style), make("rect", { x: left, y: top, width, height, fill: "#ffffff" }));
    return { text: new XMLSerializer().serializeToString(copy), width, height };
  };
  const address = (text) => "data:image/svg+xml;charset=utf-8," + encodeURIComponent(text);
  const save = (name, href) => {
    const link = document.createElement("a");
    [link.download, link.href] = [name, href];
    link.click();
  };
  for (const svg of document.querySelectorAll("figure svg.chart")) {
    const label = svg.getAttribute("aria-label") || "picture";
    const name = label.toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-|-$/g, "").slice(0, 60);
    const button = (kind, act) => {
      const made = document.createElement("button");
      [made.type, made.textContent, made.title] = ["button", kind, `Save this picture as ${kind}`];
      made.setAttribute("aria-label", `Save “${label}” as ${kind}`);
      made.addEventListener("click", act);
      return made;
    };
    const row = document.createElement("div");
    row.className = "save on-screen";
    row.append(button("SVG", () => save(name + ".svg", address(picture(svg).text))), button("PNG", () => {
      const { text, width, height } = picture(svg);
      const image = new Image();
      image.onload = () => {
        const canvas = document.createElement("canvas");
        [canvas.width, canvas.height] = [3 * width, 3 * height];
        canvas.getContext("2d").drawImage(image, 0, 0, canvas.width, canvas.height);
        save(name + ".png", canvas.toDataURL("image/png"));
      };
      image.src = address(text);
    }));
    svg.after(row);
  }
})();
