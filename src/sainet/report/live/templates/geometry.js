// Places and angles on the table; lengths in mm, angles in degrees.

const RADIAN = Math.PI / 180;
export const TOUCHING = 5; // mm: a dragged disk that is nearer than this touches

export function wrap(degrees) {
  return ((((degrees + 180) % 360) + 360) % 360) - 180;
}

export function angleOf([x, y]) {
  return Math.atan2(y, x) / RADIAN;
}

export function unit(degrees) {
  return [Math.cos(degrees * RADIAN), Math.sin(degrees * RADIAN)];
}

// The angle of the axis from disk 1 to disk 2.
export function axisOf(disks) {
  const [one, two] = disks.map((disk) => disk.pose);
  return angleOf([two[0] - one[0], two[1] - one[1]]);
}

// The contact angle whose pusher is on the side of disk 1 that a place is on.
export function contactAngleAt(view, [x, y]) {
  const [cx, cy] = view.disks[0].pose;
  if (Math.hypot(cx - x, cy - y) < 1) return null;
  return wrap(angleOf([cx - x, cy - y]) - axisOf(view.disks));
}

// Start and end of the pusher's centre.
export function strokeOf(view, aim) {
  const [x, y] = view.disks[0].pose;
  const normal = axisOf(view.disks) + aim.contact;
  const [nx, ny] = unit(normal);
  const [hx, hy] = unit(normal + aim.direction);
  const reach = view.disks[0].radius_mm + view.pusher_radius_mm;
  const start = [x - reach * nx, y - reach * ny];
  return { start, heading: [hx, hy], length: view.stroke_mm };
}

export function onTable(view, [x, y]) {
  const [low, high] = view.table_mm;
  return [clamp(x, low[0], high[0]), clamp(y, low[1], high[1])];
}

export function clamp(value, low, high) {
  return Math.min(Math.max(value, low), high);
}

// The place nearest to a wanted one where a disk is on the table and overlaps none. A
// disk that comes near another touches it: networks are trained on disks that touch.
export function freePlace(view, index, wanted) {
  let place = onTable(view, wanted);
  for (let round = 0; round < 12; round += 1) {
    view.disks.forEach((other, each) => {
      if (each === index) return;
      const reach = view.disks[index].radius_mm + other.radius_mm + 0.01;
      const offset = [place[0] - other.pose[0], place[1] - other.pose[1]];
      const distance = Math.hypot(...offset) || 1e-6;
      const isNear = round === 0 && distance < reach + TOUCHING;
      if (distance >= reach && !isNear) return;
      place = offset.map((part, axis) => other.pose[axis] + (part * reach) / distance);
    });
    place = onTable(view, place);
  }
  return place;
}

// A pose whose difference from a reference is drawn larger.
export function exaggerated(pose, reference, factor) {
  return pose.map((value, axis) => reference[axis] + factor * (value - reference[axis]));
}
