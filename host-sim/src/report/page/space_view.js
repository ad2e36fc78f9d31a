"use strict";
// Draws the bodies of a run in space: turned, cut, coloured. Where it cannot, the pictures in the page stay.
(() => {
  const data = JSON.parse(document.getElementById("space-data").textContent);
  const view = document.getElementById("view"), standIn = document.querySelector(".stand-in");
  const canvas = view && view.querySelector("canvas");
  if (!data || !canvas) return;
  // Asked before three.js, which complains on the console.
  const context = canvas.getContext("webgl2", { antialias: true, alpha: true });
  if (!context) return;
  const renderer = new THREE.WebGLRenderer({ canvas, context });
  view.hidden = false;
  if (standIn) standIn.classList.add("replaced");
  canvas.addEventListener("webglcontextlost", () => { view.hidden = true; if (standIn) standIn.classList.remove("replaced"); });

  const { number, tip } = common;
  const input = (name) => document.getElementById("view-" + name);
  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const indices = (text) => new (data.index === 2 ? Uint16Array : Uint32Array)(bytes(text).buffer);
  const vector = (numbers) => new THREE.Vector3(...numbers);
  const rest = new Float32Array(bytes(data.nodes).buffer), tetrahedra = indices(data.tetrahedra), parts = bytes(data.parts);
  const [axis, target, contact] = [data.axis, data.target, data.contact].map(vector);
  const scalars = (nodal) => nodal && Float32Array.from(new Uint16Array(bytes(nodal.values).buffer), (part) => part * nodal.step);
  const decoded = (body) => body && { ...body, strain: scalars(body.strain), von_mises: scalars(body.von_mises),
    moved_nodes: Float32Array.from(new Int16Array(bytes(body.displacements).buffer), (part) => part * body.step) };
  const bodies = data.cases.map((one) => one.strategies.map(decoded));
  const valuesOf = (body, field) => {
    if (body[field]) return body[field];
    const u = body.moved_nodes;
    return Float32Array.from({ length: u.length / 3 }, (_, i) => {
      const [x, y, z] = u.subarray(3 * i, 3 * i + 3);
      const along = field === "orthogonal" ? x * axis.x + y * axis.y + z * axis.z : 0;
      return Math.hypot(x - along * axis.x, y - along * axis.y, z - along * axis.z);
    });
  };

  // Colours of the page, and the bands of its colour bars.
  const bar = document.querySelector("#body .colours svg");
  const bands = [...bar.querySelectorAll("rect")].map((band) => new THREE.Color().setStyle(getComputedStyle(band).fill));
  const texels = new Uint8Array(bands.flatMap((band) => {
    const { r, g, b } = band.getRGB({ r: 0, g: 0, b: 0 }, THREE.SRGBColorSpace);
    return [r, g, b, 1].map((part) => Math.round(255 * part));
  }));
  const ramp = new THREE.DataTexture(texels, bands.length, 1);
  [ramp.magFilter, ramp.minFilter, ramp.colorSpace, ramp.needsUpdate] = [THREE.NearestFilter, THREE.NearestFilter, THREE.SRGBColorSpace, true];
  const painted = [];
  const paint = (material, name) => { painted.push([material, name]); return material; };
  const recolour = () => {
    const style = getComputedStyle(document.documentElement);
    for (const [material, name] of painted) material.color.setStyle(style.getPropertyValue("--" + name).trim());
  };

  const scene = new THREE.Scene();
  const lamp = new THREE.DirectionalLight(0xffffff, 1.3);
  scene.add(new THREE.AmbientLight(0xffffff, 1.9), lamp);
  const lambert = (options) => new THREE.MeshLambertMaterial({ side: THREE.DoubleSide, ...options });
  const add = (geometry, material, order = 0) => {
    const mesh = material.isLineBasicMaterial ? new THREE.LineSegments(geometry, material) : new THREE.Mesh(geometry, material);
    [mesh.renderOrder, mesh.frustumCulled] = [order, false];
    scene.add(mesh);
    return mesh;
  };
  const empty = () => new THREE.BufferGeometry();
  const skin = add(empty(), lambert({ map: ramp }), 1);
  const still = add(empty(), paint(lambert({ transparent: true, opacity: 0.14, depthWrite: false }), "quiet"), 3);
  const patches = [
    { triangles: indices(data.immobile), mesh: add(empty(), paint(lambert(), "ink"), 1) },
    { triangles: indices(data.needle), mesh: add(empty(), paint(lambert(), "quiet"), 1) },
    ...data.paddles.map(({ index, triangles }) => ({ index, triangles: indices(triangles),
      mesh: add(empty(), lambert(), 1) })),
  ];
  const led = paint(lambert(), "blue"), held = paint(lambert(), "vermillion");
  const inclusions = data.inclusions.map((text) => ({ triangles: indices(text),
    mesh: add(empty(), paint(lambert({ transparent: true, opacity: 0.5, depthWrite: false }), "orange"), 4) }));
  const planes = data.planes.map(([normal, offset]) => ({ normal: vector(normal), offset, out: vector(normal), side: 1,
    cap: add(empty(), new THREE.MeshBasicMaterial({ map: ramp, side: THREE.DoubleSide, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 2 }), 1),
    rims: add(empty(), paint(new THREE.LineBasicMaterial(), "ground"), 2) }));
  const size = data.extent;
  const shaft = new THREE.Group(), line = add(empty(), paint(new THREE.LineBasicMaterial({ transparent: true, opacity: 0.8 }), "quiet"), 5);
  const steel = paint(lambert(), "quiet");
  const long = 0.3 * size, pointed = 0.035 * size;
  const rod = new THREE.Mesh(new THREE.CylinderGeometry(0.006 * size, 0.006 * size, long - pointed, 16), steel);
  const point = new THREE.Mesh(new THREE.ConeGeometry(0.016 * size, pointed, 20), steel);
  rod.position.y = -0.5 * (long + pointed);
  point.position.y = -0.5 * pointed;
  shaft.add(rod, point);
  shaft.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), axis);
  scene.add(shaft);
  // The target is always seen: it lies inside.
  const onTop = { depthTest: false, transparent: true };
  const ball = add(new THREE.SphereGeometry(0.011 * size, 20, 14), paint(new THREE.MeshBasicMaterial(onTop), "purple"), 11);
  const ringGround = add(new THREE.TorusGeometry(0.021 * size, 0.0065 * size, 8, 40), paint(new THREE.MeshBasicMaterial(onTop), "ground"), 9);
  const ring = add(new THREE.TorusGeometry(0.021 * size, 0.0035 * size, 8, 40), paint(new THREE.MeshBasicMaterial(onTop), "purple"), 10);
  ring.position.copy(target);
  ringGround.position.copy(target);

  const camera = new THREE.PerspectiveCamera(28, 1, 0.01 * size, 100 * size);
  camera.up.copy(vector(data.view[1]));
  const controls = new THREE.OrbitControls(camera, canvas);
  controls.enableZoom = false;
  let due = false;
  const draw = () => {
    due = false;
    lamp.position.copy(camera.position).sub(controls.target);
    for (const one of [ring, ringGround]) one.quaternion.copy(camera.quaternion);
    renderer.render(scene, camera);
  };
  const ask = () => { if (!due) { due = true; requestAnimationFrame(draw); } };
  controls.addEventListener("change", ask);

  // Where the colours end, and the colour of a value: never on the edge of the texture.
  let largest = 1;
  const shade = (value) => Math.min(0.9999, Math.max(1e-4, value / largest));
  const shades = (values) => values.flatMap((value) => [shade(value), 0.5]);

  // Corners of triangles, each with its normal: that of its node among triangles that meet at less than 40°.
  const sharp = Math.cos(40 * Math.PI / 180);
  const surface = (mesh, triangles, nodes, values) => {
    const count = triangles.length, flat = new Float32Array(count), at = new Map(), value = [];
    const [a, b, c] = [0, 1, 2].map(() => new THREE.Vector3());
    for (let t = 0; t < count; t += 3) {
      [a, b, c].forEach((corner, k) => corner.fromArray(nodes, 3 * triangles[t + k]));
      b.sub(a).cross(c.sub(a)).toArray(flat, t);
      for (let k = 0; k < 3; k++) {
        const node = triangles[t + k];
        if (!at.has(node)) at.set(node, []);
        at.get(node).push(t);
      }
    }
    const position = new Float32Array(3 * count), normal = new Float32Array(3 * count);
    for (let i = 0; i < count; i++) {
      const node = triangles[i], own = i - i % 3;
      a.fromArray(flat, own).normalize();
      b.set(0, 0, 0);
      for (const other of at.get(node)) if (c.fromArray(flat, other).dot(a) > sharp * c.length()) b.add(c);
      b.normalize().toArray(normal, 3 * i);
      position.set(nodes.subarray(3 * node, 3 * node + 3), 3 * i);
      if (values) value.push(values[node]);
    }
    fill(mesh, { position, normal, ...(values && { value: new Float32Array(value), uv: new Float32Array(shades(value)) }) });
  };
  const sizes = { value: 1, uv: 2 };
  const fill = (mesh, attributes) => {
    mesh.geometry.dispose();
    mesh.geometry = empty();
    for (const [name, numbers] of Object.entries(attributes)) {
      mesh.geometry.setAttribute(name, new THREE.BufferAttribute(numbers, sizes[name] || 3));
    }
  };

  // Where a plane cuts tetrahedra, and the rims of parts in it.
  const cap = (plane, nodes, values) => {
    const distance = Float32Array.from(values, (_, i) => plane.normal.x * nodes[3 * i] + plane.normal.y * nodes[3 * i + 1] + plane.normal.z * nodes[3 * i + 2] - plane.offset);
    const position = [], value = [];
    const between = (i, j) => {
      const f = distance[i] / (distance[i] - distance[j]);
      for (let k = 0; k < 3; k++) position.push(nodes[3 * i + k] + f * (nodes[3 * j + k] - nodes[3 * i + k]));
      value.push(values[i] + f * (values[j] - values[i]));
    };
    for (let t = 0; t < tetrahedra.length; t += 4) {
      const corners = tetrahedra.subarray(t, t + 4);
      const beyond = corners.filter((node) => distance[node] >= 0), before = corners.filter((node) => distance[node] < 0);
      if (beyond.length === 2) {
        const [a, b] = beyond, [c, d] = before;
        for (const [i, j] of [[a, c], [a, d], [b, d], [a, c], [b, d], [b, c]]) between(i, j);
      } else if (beyond.length === 1) before.forEach((other) => between(beyond[0], other));
      else if (before.length === 1) beyond.forEach((other) => between(other, before[0]));
    }
    fill(plane.cap, { position: new Float32Array(position), value: new Float32Array(value), uv: new Float32Array(shades(value)) });
    const lines = [];
    for (const { triangles } of shownInclusions()) {
      for (let t = 0; t < triangles.length; t += 3) {
        for (const [i, j] of [[0, 1], [1, 2], [2, 0]].map((pair) => pair.map((k) => triangles[t + k]))) {
          if (distance[i] >= 0 === distance[j] >= 0) continue;
          const f = distance[i] / (distance[i] - distance[j]);
          // A little before the plane, so that it is seen.
          for (let k = 0; k < 3; k++) lines.push(nodes[3 * i + k] + f * (nodes[3 * j + k] - nodes[3 * i + k]) + 1e-3 * size * plane.out.getComponent(k));
        }
      }
    }
    fill(plane.rims, { position: new Float32Array(lines) });
  };

  const chosen = () => ({ place: +input("case").value, strategy: +input("strategy").value,
    field: data.fields.find(({ key }) => key === input("field").value) || data.fields[0], isNear: input("part").value === "near",
    cut: input("cut").value, times: +input("times").value });
  const shownInclusions = () => data.cases[chosen().place].has_inclusions ? inclusions : [];
  const clip = (cut) => {
    const active = planes.filter((_, i) => cut === "all" || cut === String(i));
    const keep = active.map(({ out, offset, side }) => new THREE.Plane(out.clone().negate(), side * offset));
    for (const { material } of [skin, ...patches.map(({ mesh }) => mesh)]) {
      [material.clippingPlanes, material.clipIntersection] = [keep, cut === "all"];
      material.needsUpdate = true;
    }
    for (const plane of planes) {
      plane.cap.visible = plane.rims.visible = active.includes(plane);
      const others = active.filter((other) => other !== plane).map(({ out, offset, side }) => new THREE.Plane(out.clone(), -side * offset));
      for (const { material } of [plane.cap, plane.rims]) [material.clippingPlanes, material.needsUpdate] = [others, true];
    }
    return active;
  };
  // What is cut off is on the side that is looked at.
  const face = () => {
    const towards = camera.position.clone().sub(controls.target);
    for (const plane of planes) {
      plane.side = towards.dot(plane.normal) < 0 ? -1 : 1;
      plane.out.copy(plane.normal).multiplyScalar(plane.side);
    }
  };
  renderer.localClippingEnabled = true;

  // The nodes around the target; where the mesh is coarse, the nearest ones.
  const fewest = 8;
  const distances = Float32Array.from({ length: rest.length / 3 }, (_, i) => vector(rest.subarray(3 * i, 3 * i + 3)).distanceTo(target));
  const reach = Math.max(data.near, distances.slice().sort()[Math.min(fewest, distances.length) - 1]);
  // One scale for all strategies of a case, so that colours can be compared. Of a body that lives it is the largest that was, so that
  // they keep what they mean for longer.
  let grown = {};
  const scaleOf = (place, { key, beyond }, isNear) => {
    let [end, most] = [Number.MIN_VALUE, 0];
    for (const body of bodies[place].filter(Boolean)) {
      const values = valuesOf(body, key), counted = values.filter((value, i) => !isNear || distances[i] <= reach).sort();
      end = Math.max(end, counted[counted.length - 1 - (isNear ? 0 : Math.floor(beyond * counted.length))]);
      most = values.reduce((a, b) => Math.max(a, b), most);
    }
    const name = key + isNear;
    if (data.live) end = grown[name] = Math.max(end, grown[name] || 0);
    return { end, isOpen: most > end };
  };
  // The value under the pointer: of the first surface there that is not cut off; again where the picture has changed.
  const ray = new THREE.Raycaster();
  let pointer = null;
  const isCutOff = ({ point, object: { material } }) => {
    const off = (material.clippingPlanes || []).map((plane) => plane.distanceToPoint(point) < -1e-6 * size);
    return off.length > 0 && (material.clipIntersection ? off.every(Boolean) : off.some(Boolean));
  };
  const valueUnder = ({ clientX, clientY }) => {
    const { left, top, width, height } = canvas.getBoundingClientRect();
    camera.updateMatrixWorld();
    ray.setFromCamera(new THREE.Vector2(2 * (clientX - left) / width - 1, 1 - 2 * (clientY - top) / height), camera);
    const surfaces = [skin, ...patches.map(({ mesh }) => mesh), ...planes.map(({ cap }) => cap)]
      .filter((mesh) => mesh.visible && !(mesh === skin && input("through").checked));
    const hit = ray.intersectObjects(surfaces, false).find((one) => !isCutOff(one));
    const value = hit && hit.object.geometry.getAttribute("value");
    return value && [hit.face.a, hit.face.b, hit.face.c].reduce((sum, corner, k) => sum + value.getX(corner) * hit.barycoord.getComponent(k), 0);
  };
  const read = () => {
    const value = pointer && scene.visible ? valueUnder(pointer) : undefined;
    if (value === undefined) tip.hide();
    else tip.show(pointer, [chosen().field.label + ": " + number(value)]);
  };
  canvas.addEventListener("pointermove", ({ clientX, clientY, buttons }) => { pointer = buttons ? null : { clientX, clientY }; read(); });
  canvas.addEventListener("pointerleave", () => { pointer = null; read(); });
  controls.addEventListener("change", read);

  const outsideOf = (body) => {
    const key = (triangles, t) => triangles[t] + "," + triangles[t + 1] + "," + triangles[t + 2];
    const taken = new Set();
    for (const { index, triangles } of patches) {
      if (index !== undefined && !body.paddles.includes(index)) continue;
      for (let t = 0; t < triangles.length; t += 3) taken.add(key(triangles, t));
    }
    const all = indices(data.outside), left = [];
    for (let t = 0; t < all.length; t += 3) if (!taken.has(key(all, t))) left.push(all[t], all[t + 1], all[t + 2]);
    return left;
  };
  const show = () => {
    const { place, strategy, field, isNear, cut, times } = chosen();
    const body = bodies[place][strategy], reading = document.getElementById("view-reading");
    input("times-reading").textContent = times + " ×" + (times === usual && !data.live ? " (chosen for this run)" : "");
    scene.visible = Boolean(body);
    if (!body) {
      reading.textContent = "The model did not get to the end of this insertion: there is no body to show.";
      read();
      ask();
      return;
    }
    const { end, isOpen } = scaleOf(place, field, isNear), values = valuesOf(body, field.key);
    largest = end;
    const nodes = rest.map((part, i) => part + times * body.moved_nodes[i]);
    surface(skin, outsideOf(body), nodes, values);
    for (const { index, triangles, mesh } of patches) {
      mesh.visible = index === undefined || body.paddles.includes(index);
      if (index !== undefined) mesh.material = strategy === 1 ? held : led;
      if (mesh.visible) surface(mesh, triangles, nodes, values);
    }
    for (const { triangles, mesh } of inclusions) {
      mesh.visible = shownInclusions().length > 0;
      if (mesh.visible) surface(mesh, triangles, nodes);
    }
    for (const plane of clip(cut)) cap(plane, nodes, values);
    still.visible = input("rest").checked;
    if (still.visible && !still.geometry.attributes.position) surface(still, indices(data.outside), rest);
    const through = input("through").checked;
    [skin.material.transparent, skin.material.opacity, skin.material.depthWrite] = [through, through ? 0.3 : 1, !through];
    shaft.position.copy(contact).addScaledVector(axis, times * body.depth);
    const ahead = Math.max(0, target.clone().sub(shaft.position).dot(axis) + 0.1 * size);
    fill(line, { position: new Float32Array([...shaft.position, ...shaft.position.clone().addScaledVector(axis, ahead)]) });
    ball.position.copy(target).addScaledVector(vector(body.target), times);
    const u = vector(body.target), along = u.dot(axis), unit = data.unit === "1" ? "" : " " + data.unit;
    const off = u.addScaledVector(axis, -along).length();
    const paddles = body.paddles.map((index, i) => `paddle ${index} moved ${number(body.moved[i])}${unit}`);
    reading.textContent = `Target ${number(off)}${unit} off the needle's line, ${number(along)}${unit} along it. ` +
      (paddles.length ? paddles.join(", ") + "." : "No paddle.");
    const [low, middle, high] = bar.querySelectorAll("text.tick");
    [low.textContent, middle.textContent, high.textContent] = ["0", number(end / 2), number(end) + (isOpen ? " and more" : "")];
    bar.querySelector("text.muted").textContent = field.label;
    read();
    ask();
  };
  const fit = () => {
    const { width, height } = canvas.getBoundingClientRect();
    if (!width || !height) return;
    renderer.setPixelRatio(Math.min(2, devicePixelRatio));
    renderer.setSize(width, height, false);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    ask();
  };
  const home = () => {
    const [low, high] = [new THREE.Vector3(Infinity, Infinity, Infinity), new THREE.Vector3(-Infinity, -Infinity, -Infinity)];
    for (let i = 0; i < rest.length; i += 3) { const x = vector(rest.subarray(i, i + 3)); low.min(x); high.max(x); }
    const { isNear } = chosen();
    controls.target.copy(isNear ? target : low.add(high).multiplyScalar(0.5));
    const narrow = Math.min(1, canvas.clientWidth / Math.max(1, canvas.clientHeight));
    // Twice as far as the surroundings of the target fill the height.
    const far = isNear ? 2 * reach / Math.tan(camera.fov * Math.PI / 360) : 1.8 * size;
    camera.position.copy(controls.target).addScaledVector(vector(data.view[0]), far / narrow);
    controls.update();
  };
  const turn = (aside, upwards, nearer) => {
    // In coordinates whose y is up, as spherical ones have it.
    const level = camera.up.clone(), place = camera.position.clone().sub(controls.target);
    const back = new THREE.Group().quaternion.setFromUnitVectors(level, new THREE.Vector3(0, 1, 0));
    const round = new THREE.Spherical().setFromVector3(place.applyQuaternion(back));
    round.theta += aside; round.phi -= upwards; round.radius *= nearer;
    round.makeSafe();
    camera.position.setFromSpherical(round).applyQuaternion(back.clone().invert()).add(controls.target);
    controls.update();
  };
  const keys = { ArrowLeft: [-0.15, 0, 1], ArrowRight: [0.15, 0, 1], ArrowUp: [0, 0.15, 1], ArrowDown: [0, -0.15, 1],
    "+": [0, 0, 0.9], "=": [0, 0, 0.9], "-": [0, 0, 1 / 0.9] };
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "0") home();
    else if (keys[event.key]) turn(...keys[event.key]);
    else return;
    event.preventDefault();
    ask();
  });
  // Until it is chosen, the wheel moves the page.
  canvas.addEventListener("focus", () => { controls.enableZoom = true; });
  canvas.addEventListener("blur", () => { controls.enableZoom = false; });
  canvas.addEventListener("pointerdown", (event) => { canvas.focus({ preventScroll: true }); if (event.pointerType === "touch") controls.enableZoom = true; });

  const most = Math.max(...bodies.flat().filter(Boolean).map((body) => body.moved_nodes.reduce((a, b) => Math.max(a, Math.abs(b)), 0)));
  const usual = data.live ? 1 : Math.min(20, Math.max(1, Math.round(0.1 * size / most) || 1));
  input("times").value = usual;
  for (const name of ["case", "strategy", "field", "through", "rest"]) input(name).addEventListener("change", show);
  input("part").addEventListener("change", () => { home(); face(); show(); });
  input("cut").addEventListener("change", () => { face(); show(); });
  input("times").addEventListener("input", show);
  const scheme = matchMedia("(prefers-color-scheme: dark)");
  scheme.addEventListener("change", () => { recolour(); ask(); });
  new ResizeObserver(fit).observe(canvas);
  fit();
  home();
  face();
  recolour();
  show();
  if (data.live) window.spaceView = {
    begin: (hasInclusions) => { grown = {}; data.cases[0].has_inclusions = hasInclusions; },
    show: (body) => { bodies[0][0] = decoded(body); show(); },
  };
})();
