"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const by = (id) => document.getElementById(id);
  const canvas = by("scene");
  const pen = canvas.getContext("2d");

  // ---- vectors, quaternions w x y z, poses {r, p}
  const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
  const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
  const times = (a, k) => [a[0] * k, a[1] * k, a[2] * k];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const long = (a) => Math.sqrt(dot(a, a));
  const unit = (a) => times(a, 1 / (long(a) || 1));
  const turned = (r, v) => {
    const u = [r[1], r[2], r[3]];
    const t = times(cross(u, v), 2);
    return add(add(v, times(t, r[0])), cross(u, t));
  };
  const product = (a, b) => [
    a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
    a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
    a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
    a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]];
  const pose = (seven) => ({ r: seven.slice(0, 4), p: seven.slice(4, 7) });
  const WORLD = { r: [1, 0, 0, 0], p: [0, 0, 0] };
  const after = (a, b) => ({ r: product(a.r, b.r), p: add(a.p, turned(a.r, b.p)) });
  const point = (a, v) => add(a.p, turned(a.r, v));

  // ---- motion: links' poses at any time, between samples
  const samples = data.poses.length;
  const links = samples ? data.poses[0].length / 7 : 0;
  function posesAt(part) {
    const x = part * (samples - 1);
    const k = Math.min(Math.floor(x), Math.max(samples - 2, 0));
    const f = samples > 1 ? x - k : 0;
    const a = data.poses[k], b = data.poses[Math.min(k + 1, samples - 1)];
    const out = [];
    for (let l = 0; l < links; l++) {
      const i = 7 * l;
      const ra = a.slice(i, i + 4), rb = b.slice(i, i + 4);
      const same = ra.reduce((s, v, j) => s + v * rb[j], 0) < 0 ? -1 : 1;
      const r = ra.map((v, j) => v + f * (same * rb[j] - v));
      const size = Math.hypot(...r) || 1;
      out.push({ r: r.map((v) => v / size), p: [4, 5, 6].map((j) => a[i + j] + f * (b[i + j] - a[i + j])) });
    }
    return out;
  }
  const sampleBefore = (part) => (samples > 1 ? Math.floor(part * (samples - 1)) / (samples - 1) : 0);
  function valuesAt(part) {
    const x = part * (samples - 1);
    const k = Math.min(Math.floor(x), Math.max(samples - 2, 0));
    const f = samples > 1 ? x - k : 0;
    const a = data.q[k], b = data.q[Math.min(k + 1, samples - 1)];
    return a.map((v, j) => v + f * (b[j] - v));
  }

  // ---- what there is to see, and how large it is
  const at = (poses, link) => (link === null ? WORLD : poses[link]);
  const joints = data.joints.map((j) => ({ ...j, axes: j.axes.map((a) => ({ ...a, frame: pose(a.frame) })) }));
  const cuts = data.cuts.map((c) => ({ ...c, sides: c.sides.map(([link, on]) => [link, pose(on)]) }));
  const springs = data.springs;
  const jointSprings = data.joint_springs.map((s) => ({ ...s, on: { ...s.on, frame: pose(s.on.frame) } }));
  const tips = (poses, spring) => spring.ends.map(([link, v]) => point(at(poses, link), v));
  const driven = new Set(data.drives.filter((d) => d.actuated).flatMap((d) => d.moves));
  const ends = (poses, cut) => cut.sides.map(([link, on]) => after(at(poses, link), on));
  function solid(poses) {
    const points = [[0, 0, 0]];
    for (const b of data.bodies) for (const p of b.points) points.push(point(poses[b.link], p));
    for (const j of joints) for (const a of j.axes) points.push(after(at(poses, a.parent), a.frame).p);
    for (const c of cuts) for (const e of ends(poses, c)) points.push(e.p);
    for (const s of springs) points.push(...tips(poses, s));
    return points;
  }
  const everywhere = [];
  for (let k = 0; k < 24; k++) everywhere.push(...solid(posesAt(k / 23)));
  const home = solid(posesAt(0));
  const low = [0, 1, 2].map((i) => Math.min(...home.map((p) => p[i])));
  const high = [0, 1, 2].map((i) => Math.max(...home.map((p) => p[i])));
  const middle = times(add(low, high), 0.5);
  const farthest = (points) => Math.max(...points.map((p) => long(sub(p, middle))), 1e-3);
  const size = farthest(home);
  // what a long arm sweeps would leave it small: its farthest ends may leave the picture
  const reach = Math.min(farthest(everywhere), 1.5 * size);
  // where all axes pass through one point, joints are drawn on a ball around it, bodies as its arcs
  const ball_of = Math.max(...home.map((p) => long(sub(p, middle)))) < 1e-9 ? 0.8 * size : 0;
  const glyph = (ball_of ? 0.11 : 0.055) * size;
  const out = (p, axis) => add(p, times(axis, ball_of));

  // ---- the eye
  const up = unit(data.up);
  const east = unit(Math.abs(up[0]) < 0.9 ? sub([1, 0, 0], times(up, up[0])) : [0, 1, 0]);
  const north = cross(up, east);
  const VIEWS = { iso: [-0.6, 0.42], front: [-Math.PI / 2, 0], side: [0, 0], top: [-Math.PI / 2, 1.5533] };
  const eye = { yaw: -0.6, pitch: 0.42, away: 3.1 * reach, to: middle.slice() };
  let place;
  function look() {
    const { clientWidth: w, clientHeight: h } = canvas;
    const ratio = window.devicePixelRatio || 1;
    if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) {
      canvas.width = Math.round(w * ratio);
      canvas.height = Math.round(h * ratio);
    }
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    const flat = add(times(east, Math.cos(eye.yaw)), times(north, Math.sin(eye.yaw)));
    const back = add(times(flat, Math.cos(eye.pitch)), times(up, Math.sin(eye.pitch)));
    const right = unit(cross(up, flat));
    const top = cross(back, right);
    const narrow = w <= 640;
    const free = narrow ? { x: w / 2, y: h * 0.36, s: Math.min(w, h * 0.62) }
      : { x: (w - 200) / 2, y: h / 2 - 24, s: Math.min(w - 220, h - 60) };
    const from = add(eye.to, times(back, eye.away));
    const zoom = 1.35 * free.s;
    place = (p) => {
      const d = sub(p, from);
      const depth = -dot(d, back);
      const k = zoom / Math.max(depth, 1e-3 * reach);
      return [free.x + k * dot(d, right), free.y - k * dot(d, top), depth, k];
    };
    return { w, h, right, top, scale: zoom / eye.away };
  }

  // ---- colours from the page's style
  let ink = {};
  function dyes() {
    const style = getComputedStyle(document.documentElement);
    for (const name of ["ground", "ink", "soft", "line", "grid", "accent", "passive", "cut", "wrong", "spring", "pull", "load", "x", "y", "z", "halo", "metal"]) {
      ink[name] = style.getPropertyValue("--" + name).trim();
    }
    const dark = matchMedia("(prefers-color-scheme: dark)").matches;
    ink.bodies = data.bodies.map((_, k) => `hsl(${(205 + 137.5 * k) % 360} ${dark ? "45% 62%" : "42% 46%"}`);
  }
  const solidOf = (k, alpha) => ink.bodies[k] + ` / ${alpha})`;

  // ---- primitives, painted from far to near
  let paint;
  const depthOf = (ps) => ps.reduce((s, p) => s + place(p)[2], 0) / ps.length;
  function line(a, b, width, dye, dash) {
    paint.push([depthOf([a, b]), () => {
      const [x, y] = place(a), [u, v] = place(b);
      pen.beginPath(); pen.moveTo(x, y); pen.lineTo(u, v);
      pen.lineWidth = width; pen.strokeStyle = dye; pen.lineCap = "round"; pen.setLineDash(dash || []);
      pen.stroke(); pen.setLineDash([]);
    }]);
  }
  function face(points, dye, edge) {
    paint.push([depthOf(points) + 1e-6 * size, () => {
      pen.beginPath();
      points.forEach((p, k) => { const [x, y] = place(p); k ? pen.lineTo(x, y) : pen.moveTo(x, y); });
      pen.closePath(); pen.fillStyle = dye; pen.fill();
      if (edge) { pen.lineWidth = 1; pen.strokeStyle = edge; pen.stroke(); }
    }]);
  }
  function ball(p, radius, fill, edge, width) {
    paint.push([depthOf([p]) - radius, () => {
      const [x, y, , k] = place(p);
      pen.beginPath(); pen.arc(x, y, Math.max(radius * k, 2.5), 0, 2 * Math.PI);
      pen.fillStyle = fill; pen.fill(); pen.lineWidth = width || 1.5; pen.strokeStyle = edge; pen.stroke();
    }]);
  }
  const words = [];
  function word(p, text, dye, bold) {
    words.push([place(p), text, dye, bold]);
  }
  /** A drum about an axis. */
  function drum(p, axis, radius, half, fill, edge) {
    const a = unit(Math.abs(axis[0]) < 0.8 ? cross(axis, [1, 0, 0]) : cross(axis, [0, 1, 0]));
    const b = cross(axis, a);
    const ring = (s) => Array.from({ length: 14 }, (_, k) => {
      const t = 2 * Math.PI * k / 14;
      return add(add(p, times(axis, s)), add(times(a, radius * Math.cos(t)), times(b, radius * Math.sin(t))));
    });
    const lo = ring(-half), hi = ring(half);
    for (let k = 0; k < 14; k++) {
      const n = (k + 1) % 14;
      face([lo[k], lo[n], hi[n], hi[k]], fill, k % 7 === 0 ? edge : fill);
    }
    face(lo, fill, edge); face(hi, fill, edge);
  }
  /** A box along an axis. */
  function box(p, axis, half, wide, fill, edge) {
    const a = unit(Math.abs(axis[0]) < 0.8 ? cross(axis, [1, 0, 0]) : cross(axis, [0, 1, 0]));
    const b = cross(axis, a);
    const c = (s, i, j) => add(add(p, times(axis, s * half)), add(times(a, i * wide), times(b, j * wide)));
    const square = [[1, 1], [-1, 1], [-1, -1], [1, -1]];
    for (let k = 0; k < 4; k++) {
      const [i, j] = square[k], [m, n] = square[(k + 1) % 4];
      face([c(-1, i, j), c(-1, m, n), c(1, m, n), c(1, i, j)], fill, edge);
    }
    for (const s of [-1, 1]) face(square.map(([i, j]) => c(s, i, j)), fill, edge);
  }

  function ground() {
    const base = Math.min(...home.map((p) => dot(p, up)));
    const step = Math.pow(10, Math.floor(Math.log10(reach))) * (reach / Math.pow(10, Math.floor(Math.log10(reach))) > 4 ? 1 : 0.5) / 2;
    const n = Math.min(Math.ceil(1.3 * reach / step), 16);
    const origin = times(up, base);
    pen.lineWidth = 1; pen.strokeStyle = ink.grid;
    const [e, f] = [dot(middle, east), dot(middle, north)].map((v) => Math.round(v / step));
    for (let k = -n; k <= n; k++) {
      for (const [u, v, i, j] of [[east, north, e, f], [north, east, f, e]]) {
        const c = add(origin, times(u, (k + i) * step));
        const [x, y] = place(add(c, times(v, (j - n) * step))), [z, w] = place(add(c, times(v, (j + n) * step)));
        pen.beginPath(); pen.moveTo(x, y); pen.lineTo(z, w); pen.stroke();
      }
    }
  }
  function triad(frame, length, width, names) {
    [["x", [1, 0, 0]], ["y", [0, 1, 0]], ["z", [0, 0, 1]]].forEach(([name, v]) => {
      const tip = point(frame, times(v, length));
      line(frame.p, tip, width, ink[name]);
      if (names) word(tip, name, ink[name]);
    });
  }

  const { drawSprings, drawPayload } = mechanics({
    add, sub, times, unit, cross, turned, after, at, point, line, face, ball, word, ink, glyph,
    springs, jointSprings, tips, shows: (what) => by(what).checked,
  });
  function drawBodies(poses) {
    data.bodies.forEach((body, k) => {
      const frame = poses[body.link];
      const points = body.points.map((p) => point(frame, p));
      if (body.payload) {
        drawPayload(body, poses);
        if (points.length > 1) line(points[0], points[1], 2, ink.load, [4, 3]);
        return;
      }
      // where a slide carries the body, its rail belongs to it
      for (const j of joints) {
        const last = j.axes[j.axes.length - 1];
        if (j.link === body.link && (j.kind === "prismatic" || j.kind === "cylindrical")) {
          const before = after(at(poses, last.parent), last.frame).p;
          if (long(sub(before, frame.p)) > 1e-6) line(before, frame.p, Math.max(2.5, 0.022 * size * place(frame.p)[3]), solidOf(k, 0.9));
        }
      }
      const thick = Math.max(2.5, 0.03 * size * place(frame.p)[3]);
      if (ball_of) { drawArcs(body, poses, thick, solidOf(k, 0.95)); return; }
      if (points.length === 2) line(points[0], points[1], thick, solidOf(k, 0.95));
      if (points.length < 3) return;
      const c = times(points.reduce(add), 1 / points.length);
      // in order about the normal of their widest triangle
      let n = [0, 0, 0];
      for (let i = 0; i < points.length; i++) for (let m = 0; m < i; m++) {
        const t = cross(sub(points[i], c), sub(points[m], c));
        if (long(t) > long(n)) n = t;
      }
      if (long(n) < 1e-9 * size * size) {
        let far = [points[0], points[1]];
        for (const a of points) for (const b of points) if (long(sub(a, b)) > long(sub(...far))) far = [a, b];
        line(far[0], far[1], thick, solidOf(k, 0.95));
        return;
      }
      const a = unit(sub(points.find((p) => long(sub(p, c)) > 1e-6 * size), c)), b = cross(unit(n), a);
      const order = points.slice().sort((p, q) => {
        const angle = (v) => Math.atan2(dot(sub(v, c), b), dot(sub(v, c), a));
        return angle(p) - angle(q);
      });
      face(order, solidOf(k, 0.22));
      order.forEach((p, i) => line(p, order[(i + 1) % order.length], Math.max(2, thick * 0.6), solidOf(k, 0.9)));
    });
    // what stands on the world stands on a pole
    for (const j of joints) {
      if (j.parent !== null) continue;
      const p = j.axes[0].frame.p;
      if (long(p) > 1e-6) line([0, 0, 0], p, 1, ink.line, [4, 4]);
    }
  }
  /** A body of a mechanism whose axes meet, from each of its axes to the next. */
  function drawArcs(body, poses, thick, dye) {
    const axes = [];
    for (const j of joints) {
      const a = j.axes[0];
      if (a.parent === body.link || j.link === body.link) axes.push(turned(after(at(poses, a.parent), a.frame).r, a.axis));
    }
    for (const c of cuts) c.sides.forEach(([link], k) => {
      if (link === body.link) axes.push(turned(ends(poses, c)[k].r, [0, 0, 1]));
    });
    for (let k = 1; k < axes.length; k++) {
      const [from, to] = [axes[k - 1], axes[k]];
      const on = (f) => out(middle, unit(add(times(from, 1 - f), times(to, f))));
      for (let n = 0; n < 12; n++) line(on(n / 12), on((n + 1) / 12), thick, dye);
    }
  }
  function drawJoints(poses) {
    for (const j of joints) {
      const first = j.axes[0];
      const before = after(at(poses, first.parent), first.frame);
      const moved = !j.actuated && j.coordinates.some((c) => driven.has(c));
      const dye = j.actuated || moved ? ink.accent : ink.passive;
      const fill = j.actuated ? ink.accent : ink.metal;
      if (by("axes").checked) {
        for (const a of j.axes.length > 1 && j.kind !== "cylindrical" ? [] : j.axes.slice(0, 1)) {
          const frame = after(at(poses, a.parent), a.frame);
          const axis = turned(frame.r, a.axis);
          const p = out(frame.p, axis);
          line(ball_of ? frame.p : sub(p, times(axis, 2.6 * glyph)), add(p, times(axis, 2.6 * glyph)), 1.25, dye, [7, 4]);
          if (j.kind === "prismatic") box(p, axis, glyph, 0.42 * glyph, fill, dye);
          else drum(p, axis, 0.55 * glyph, 0.75 * glyph, fill, dye);
        }
        if (j.kind === "spherical") ball(before.p, 0.55 * glyph, fill, dye);
        if (j.kind === "universal") {
          for (const a of j.axes) {
            const frame = after(at(poses, a.parent), a.frame);
            const axis = turned(frame.r, a.axis);
            drum(frame.p, axis, 0.32 * glyph, 0.95 * glyph, fill, dye);
          }
        }
      }
      if (by("names").checked) word(out(before.p, turned(before.r, first.axis)), j.name, dye, j.actuated);
    }
  }
  function drawCuts(poses, sample) {
    const open = [];
    for (const cut of cuts) {
      const [a, b] = ends(poses, cut);
      // slides and cylinders let the origins part along the axis
      const free = cut.kind === "prismatic" || cut.kind === "cylindrical";
      // judged at the sample before: what is between two closed samples gapes by the way it is
      // drawn, and samples are rounded to micrometres
      const gap = long(sub(...ends(sample, cut).map((e) => e.p)));
      const wrong = !free && gap > Math.max(1e-4 * size, 4e-6);
      const dye = wrong ? ink.wrong : ink.cut;
      if (wrong) line(a.p, b.p, 2.5, ink.wrong, [3, 5]);
      for (const e of wrong ? [a, b] : [a]) {
        if (cut.kind === "spherical" || cut.kind === "universal") ball(e.p, 0.55 * glyph, ink.ground, dye, 3);
        else {
          const axis = turned(e.r, [0, 0, 1]), p = out(e.p, axis);
          drum(p, axis, 0.55 * glyph, 0.75 * glyph, ink.ground, dye);
          if (by("axes").checked) line(ball_of ? e.p : sub(p, times(axis, 2.2 * glyph)), add(p, times(axis, 2.2 * glyph)), 1.25, dye, [2, 4]);
        }
      }
      if (wrong) open.push(cut.name);
      if (by("names").checked) word(out(a.p, turned(a.r, [0, 0, 1])), wrong ? `${cut.name}: open by ${gap.toPrecision(3)} m` : cut.name, dye, true);
    }
    by("scene").dataset.open = open.join(" ");
  }

  function draw(part) {
    const seen = look();
    pen.clearRect(0, 0, seen.w, seen.h);
    ground();
    paint = []; words.length = 0;
    const poses = posesAt(part);
    if (by("bodies").checked) drawBodies(poses);
    drawJoints(poses);
    if (by("springs").checked) drawSprings(poses);
    if (by("cuts").checked) drawCuts(poses, posesAt(sampleBefore(part)));
    triad(WORLD, 3.2 * glyph, 2, true);
    if (by("frames").checked) data.bodies.forEach((b) => triad(poses[b.link], 2.2 * glyph, 2, true));
    if (by("labels").checked) {
      data.bodies.forEach((b, k) => {
        const points = b.points.map((p) => point(poses[b.link], p));
        word(times(points.reduce(add), 1 / points.length), b.label, solidOf(k, 1), true);
      });
    }
    paint.sort((a, b) => b[0] - a[0]);
    for (const [, stroke] of paint) stroke();
    // words move down from one another until none covers another
    const taken = [];
    words.sort((a, b) => a[0][1] - b[0][1] || a[0][0] - b[0][0]);
    pen.textBaseline = "middle"; pen.lineJoin = "round";
    for (const [[x, y], text, dye, bold] of words) {
      pen.font = `${bold ? "600 " : ""}12px system-ui, "DejaVu Sans", sans-serif`;
      const wide = pen.measureText(text).width;
      const box = { x: Math.max(2, Math.min(x + 11, seen.w - wide - 4)), y: y - 10, w: wide, h: 14 };
      for (let tries = 0; tries < 12; tries++) {
        const hit = taken.find((t) => box.x < t.x + t.w && t.x < box.x + box.w && box.y < t.y + t.h && t.y < box.y + box.h);
        if (!hit) break;
        box.y = hit.y + hit.h;
      }
      taken.push({ ...box, text, dye, font: pen.font });
    }
    // all halos under all words
    for (const { x, y, text, font } of taken) {
      pen.font = font; pen.lineWidth = 4; pen.strokeStyle = ink.halo; pen.strokeText(text, x, y + 7);
    }
    for (const { x, y, text, font, dye } of taken) {
      pen.font = font; pen.fillStyle = dye; pen.fillText(text, x, y + 7);
    }
    caption(part);
  }

  // ---- the panel
  by("description").textContent = data.description;
  if (data.note) { by("note").hidden = false; by("note").textContent = data.note; }
  const rows = data.coordinates.map((c) => {
    const row = by("values").querySelector("table").insertRow();
    row.insertCell().textContent = c.name;
    row.insertCell();
    row.insertCell().textContent = c.turn ? "°" : "m";
    if (c.independent) { row.className = "independent"; row.title = "independent"; }
    return row;
  });
  if (data.coordinates.length > 14 || innerWidth <= 640) by("values").open = false;
  for (const [name, [yaw, pitch]] of Object.entries(VIEWS)) {
    const button = document.createElement("button");
    button.type = "button"; button.textContent = name;
    button.onclick = () => { Object.assign(eye, { yaw, pitch, away: 3.1 * reach, to: middle.slice() }); show(); };
    by("views").append(button);
  }
  const kinds = [["accent", "actuated joint"], ["passive", "passive joint"]];
  if (driven.size) kinds.splice(1, 0, ["accent", "joint that a drive moves", true]);
  if (cuts.length) kinds.push(["cut", "joint cut to open a loop"]);
  if (springs.some((s) => !s.constant)) kinds.push(["spring", "spring between points"]);
  if (jointSprings.length) kinds.push(["spring", "spring at a joint", true]);
  if (springs.some((s) => s.constant)) kinds.push(["pull", "constant pull (or push) between points"]);
  if (data.bodies.some((b) => b.payload)) kinds.push(["load", "payload, carried in some runs", true]);
  by("has-springs").hidden = !springs.length && !jointSprings.length;
  by("drives").hidden = !data.drives.length;
  for (const drive of data.drives) {
    const row = by("drives").querySelector("table").insertRow();
    row.insertCell().textContent = drive.name;
    row.insertCell().textContent = "= " + drive.form;
    if (drive.actuated) { row.className = "actuated"; row.title = "actuated"; }
  }
  for (const [dye, text, ring] of kinds) {
    const item = document.createElement("li"), dot = document.createElement("i");
    if (ring) dot.style.boxShadow = `inset 0 0 0 2px var(--${dye})`;
    else dot.style.background = `var(--${dye})`;
    item.append(dot, text);
    by("legend").append(item);
  }
  function caption(part) {
    const k = part * (samples - 1);
    let what = "";
    for (const [from, name] of data.parts) if (from <= k + 1e-9) what = name;
    by("now").textContent = samples > 1 ? `${(part * data.duration).toFixed(2)} s · ${what}` : what;
    const q = valuesAt(part);
    rows.forEach((row, j) => {
      const c = data.coordinates[j];
      row.cells[1].textContent = c.turn ? (q[j] * 180 / Math.PI).toFixed(1) : q[j].toFixed(4);
    });
  }

  // ---- time
  let part = 0, playing = samples > 1, last = null, waiting = false;
  function show() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame((now) => {
      waiting = false;
      if (playing) {
        if (last !== null) part = (part + (now - last) / 1000 / data.duration) % 1;
        last = now;
        by("time").value = Math.round(part * 1000);
      }
      draw(part);
      if (playing) show();
    });
  }
  function play(on) {
    playing = on && samples > 1; last = null;
    by("play").textContent = playing ? "Pause" : "Play";
    show();
  }
  by("play").onclick = () => play(!playing);
  by("time").oninput = () => { play(false); part = by("time").value / 1000; show(); };
  by("shown").onchange = show;
  if (samples < 2) { by("play").disabled = true; by("time").disabled = true; }

  // ---- hands: one finger or the left button turns, the right one shifts, two fingers both
  const held = new Map();
  canvas.oncontextmenu = (e) => e.preventDefault();
  canvas.onpointerdown = (e) => { canvas.setPointerCapture(e.pointerId); held.set(e.pointerId, e); };
  canvas.onpointerup = canvas.onpointercancel = (e) => held.delete(e.pointerId);
  function shift(dx, dy) {
    const { right, top, scale } = look();
    eye.to = add(eye.to, add(times(right, -dx / scale), times(top, dy / scale)));
  }
  const nearer = (by) => { eye.away = Math.min(Math.max(eye.away * by, 0.15 * reach), 40 * reach); };
  canvas.onpointermove = (e) => {
    const old = held.get(e.pointerId);
    if (!old) return;
    const dx = e.clientX - old.clientX, dy = e.clientY - old.clientY;
    if (held.size === 2) {
      const other = [...held].find(([id]) => id !== e.pointerId)[1];
      const span = (p) => Math.hypot(p.clientX - other.clientX, p.clientY - other.clientY) || 1;
      nearer(span(old) / span(e));
      shift(dx / 2, dy / 2);
    } else if (e.buttons & 2 || e.shiftKey) shift(dx, dy);
    else {
      eye.yaw -= 0.008 * dx;
      eye.pitch = Math.min(Math.max(eye.pitch + 0.008 * dy, -1.55), 1.55);
    }
    held.set(e.pointerId, e);
    show();
  };
  canvas.addEventListener("wheel", (e) => { e.preventDefault(); nearer(Math.exp(0.0012 * e.deltaY)); show(); }, { passive: false });
  addEventListener("keydown", (e) => {
    if (e.target !== canvas && e.target !== document.body) return;
    if (e.key === " ") { e.preventDefault(); play(!playing); }
    else if (["+", "=", "-"].includes(e.key) && !e.ctrlKey && !e.metaKey) { nearer(e.key === "-" ? 1.2 : 1 / 1.2); show(); }
    else if (e.key === "ArrowLeft" || e.key === "ArrowRight") {
      play(false);
      part = Math.min(Math.max(part + (e.key === "ArrowLeft" ? -0.005 : 0.005), 0), 1);
      by("time").value = Math.round(part * 1000);
      show();
    }
  });
  addEventListener("resize", show);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { dyes(); show(); });

  // a page that shows this one in a frame may keep the camera from one mechanism to the next
  if (parent !== window) {
    const tell = () => parent.postMessage({ camera: eye }, "*");
    addEventListener("message", (e) => {
      const { yaw, pitch, away, to } = (e.source === parent && e.data && e.data.camera) || {};
      if (!Array.isArray(to) || to.length !== 3 || ![yaw, pitch, away, ...to].every(Number.isFinite)) return;
      Object.assign(eye, { yaw, pitch, away, to }); show(); tell();
    });
    for (const hand of ["pointerup", "wheel"]) canvas.addEventListener(hand, tell, { passive: true });
    addEventListener("keyup", tell);
  }

  // a link to a moment: #t=0.25, parts of the whole
  const moment = /[#&]t=([\d.]+)/.exec(location.hash);
  dyes();
  if (moment) { part = Math.min(Math.max(parseFloat(moment[1]) || 0, 0), 1); by("time").value = Math.round(part * 1000); play(false); }
  else play(samples > 1 && !matchMedia("(prefers-reduced-motion: reduce)").matches);
  draw(part); // at once: whoever loads the page need not wait for the first frame
})();
