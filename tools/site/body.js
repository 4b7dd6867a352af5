// The body of helpers/robot/body.py: a disc among walls [x0, y0, x1, y1], in steps of 0.02 s.
export function body({ walls, start: [x, y, yaw], limits: [radius, acceleration, turning, seconds] }) {
  const now = { x, y, yaw, v: 0, w: 0, bumps: [], touching: false };
  const apart = (low, at, high) => Math.max(low - at, 0, at - high);
  const clearance = at => Math.min(...walls.map(
    ([x0, y0, x1, y1]) => Math.hypot(apart(x0, at.x, x1), apart(y0, at.y, y1)))) - radius;
  const towards = (value, target, most) => value + Math.max(-most, Math.min(most, target - value));

  function arc(v, w, part) {
    const half = w * seconds * part / 2;
    const chord = v * seconds * part * (Math.abs(half) > 1e-9 ? Math.sin(half) / half : 1);
    const along = now.yaw + half;
    return { x: now.x + chord * Math.cos(along), y: now.y + chord * Math.sin(along), yaw: now.yaw + 2 * half };
  }

  // Change the speeds towards those that are wanted, and move; into a wall as far as to touch it.
  function step(v, w) {
    const [oldV, oldW] = [now.v, now.w];
    now.v = towards(oldV, v, acceleration * seconds);
    now.w = towards(oldW, w, turning * seconds);
    const means = [(oldV + now.v) / 2, (oldW + now.w) / 2];
    const end = arc(...means, 1);
    if (clearance(end) >= 0 || !means[0]) {
      now.touching = now.touching && clearance(end) < 0.005;
      return Object.assign(now, end);
    }
    let [free, blocked] = [0, 1];
    for (let i = 0; i < 50; i += 1) {
      const half = (free + blocked) / 2;
      if (clearance(arc(...means, half)) >= 0) free = half;
      else blocked = half;
    }
    Object.assign(now, arc(...means, free), { yaw: end.yaw, v: 0 });
    if (!now.touching) now.bumps.push({ ...now });
    now.touching = true;
    return now;
  }

  // How far a beam goes, 8 m at most: to where it is between both pairs of a wall's edges.
  function range(angle) {
    const [cos, sin] = [Math.cos(angle) || 1e-12, Math.sin(angle) || 1e-12];
    return Math.min(8, ...walls.map(([x0, y0, x1, y1]) => {
      const [a, b, c, d] = [(x0 - now.x) / cos, (x1 - now.x) / cos, (y0 - now.y) / sin, (y1 - now.y) / sin];
      const enter = Math.max(Math.min(a, b), Math.min(c, d), 0);
      return enter <= Math.min(Math.max(a, b), Math.max(c, d)) ? enter : 8;
    }));
  }

  return { now, step, range };
}
