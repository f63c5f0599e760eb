"use strict";
/** Draws springs, pulls and payloads with the vectors and pens of the page. */
function mechanics(page) {
  const { add, sub, times, unit, cross, turned, after, at, point, line, face, ball, word, ink, glyph } = page;
  const across = (axis) => unit(Math.abs(axis[0]) < 0.8 ? cross(axis, [1, 0, 0]) : cross(axis, [0, 1, 0]));
  /** A line through points. */
  function path(points, width, dye) {
    for (let k = 1; k < points.length; k++) line(points[k - 1], points[k], width, dye);
  }
  /** A spring from one point to another: straight ends, and turns in between. */
  function coil(a, b, dye) {
    const way = sub(b, a), axis = unit(way);
    const u = across(axis);
    const v = cross(axis, u), radius = 0.45 * glyph, turns = 7, each = 10;
    const points = [a];
    for (let k = 0; k <= turns * each; k++) {
      const t = 2 * Math.PI * k / each;
      const on = add(a, times(way, 0.12 + 0.76 * k / (turns * each)));
      points.push(add(on, add(times(u, radius * Math.cos(t)), times(v, radius * Math.sin(t)))));
    }
    points.push(b);
    path(points, 1.75, dye);
  }
  /** A pull between two points: a line with an arrow inwards at each end. */
  function pull(a, b, dye) {
    line(a, b, 1.75, dye);
    for (const [from, to] of [[a, b], [b, a]]) {
      const axis = unit(sub(to, from));
      const side = across(axis);
      const tip = add(from, times(axis, 1.4 * glyph));
      for (const w of [side, cross(axis, side)]) {
        const back = add(from, times(axis, 0.6 * glyph));
        face([tip, add(back, times(w, 0.35 * glyph)), add(back, times(w, -0.35 * glyph))], dye);
      }
    }
  }
  /** A spring about or along the axis of a joint. */
  function jointSpring(spring, poses) {
    const frame = after(at(poses, spring.on.parent), spring.on.frame);
    const axis = turned(frame.r, spring.on.axis);
    if (!spring.turn) {
      // from where it is relaxed to the body that slides
      const rest = add(frame.p, times(axis, spring.rest)), now = poses[spring.on.link].p;
      const side = across(axis);
      const beside = times(side, glyph);
      coil(add(rest, beside), add(now, beside), ink.spring);
      return;
    }
    const u = across(axis);
    const v = cross(axis, u), points = [];
    const on = add(frame.p, times(axis, 1.1 * glyph));
    for (let k = 0; k <= 48; k++) {
      const t = 2 * Math.PI * k / 16, r = (0.5 + k / 48) * glyph;
      points.push(add(on, add(times(u, r * Math.cos(t)), times(v, r * Math.sin(t)))));
    }
    path(points, 1.75, ink.spring);
  }

  function drawSprings(poses) {
    const named = page.shows("names");
    for (const spring of page.springs) {
      const [a, b] = page.tips(poses, spring);
      const dye = spring.constant ? ink.pull : ink.spring;
      (spring.constant ? pull : coil)(a, b, dye);
      for (const p of [a, b]) ball(p, 0.18 * glyph, dye, dye);
      if (named) word(times(add(a, b), 0.5), spring.name, dye);
    }
    for (const spring of page.jointSprings) jointSpring(spring, poses);
  }
  function drawPayload(body, poses) {
    const frame = poses[body.link];
    const corner = (i, j, k) => point(frame, [i, j, k].map((v) => 0.9 * v * glyph));
    for (const [i, j] of [[1, 1], [1, -1], [-1, 1], [-1, -1]]) {
      line(corner(i, j, -1), corner(i, j, 1), 2, ink.load, [4, 3]);
      line(corner(i, -1, j), corner(i, 1, j), 2, ink.load, [4, 3]);
      line(corner(-1, i, j), corner(1, i, j), 2, ink.load, [4, 3]);
    }
    if (page.shows("names") && !page.shows("labels")) word(frame.p, body.label, ink.load);
  }
  return { drawSprings, drawPayload };
}
