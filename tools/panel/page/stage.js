// Draws the robot from its side, from what its body or its own estimate says. Positive angles lean forward.
const SEEN_M = 1.35, BELOW_PX = 26;
const FORCE_M_PER_N = 0.0025;

export function makeStage(canvas, colour) {
  const context = canvas.getContext("2d");
  let geometry = { leg: 0.96, radius: { outer: 0.2, inner: 0.2 }, eccentricity: { outer: 0.146, inner: 0.146 }, heel: -0.1, toe: 0.9 };
  let names = [];

  // {hip: [x, y], legs: {side: {leg, foot, force}}} of the values, or of the estimate: the lower foot then stands.
  function posed(values) {
    const of = (name) => { const at = names.indexOf(name); return at < 0 ? undefined : values[at]; };
    if (names.includes("hip_y_m")) {
      return { hip: [of("hip_x_m"), of("hip_y_m")], legs: {
        outer: { leg: of("leg_outer_rad"), foot: of("foot_outer_rad"), force: [of("outer_Fx_N"), of("outer_Fy_N")] },
        inner: { leg: of("leg_inner_rad"), foot: of("foot_inner_rad"), force: [of("inner_Fx_N"), of("inner_Fy_N")] } } };
    }
    const legs = { outer: { leg: of("leg_outer_rad"), foot: of("foot_outer_rad") }, inner: { leg: of("leg_inner_rad"), foot: of("foot_inner_rad") } };
    const below = (side) => geometry.leg * Math.cos(legs[side].leg) - geometry.eccentricity[side] * Math.cos(legs[side].foot) + geometry.radius[side];
    return { hip: [0, Math.max(below("outer"), below("inner"))], legs };
  }

  function draw(values) {
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    const scale = (height - BELOW_PX) / (SEEN_M - 0.1), ground = height - BELOW_PX;
    const pose = values ? posed(values) : null;
    const x0 = pose ? pose.hip[0] : 0;
    const at = (x, y) => [(x - x0) * scale + width / 2, ground - y * scale];
    context.fillStyle = colour("floor");
    context.fillRect(0, ground, width, BELOW_PX);
    context.fillStyle = colour("soft");
    context.font = "11px system-ui, sans-serif";
    const half = width / 2 / scale;
    for (let metres = Math.ceil((x0 - half) * 2) / 2; metres <= x0 + half; metres += 0.5) {
      const [x] = at(metres, 0);
      context.fillRect(x, ground + 3, 1, 6);
      context.fillText(`${metres.toFixed(1)} m`, x + 3, ground + 17);
    }
    if (!pose || !Number.isFinite(pose.hip[1])) return;
    for (const side of ["inner", "outer"]) leg(at, pose.hip, side, pose.legs[side]);
    context.fillStyle = colour("ink");
    context.beginPath();
    context.arc(...at(...pose.hip), 8, 0, 2 * Math.PI);
    context.fill();
  }

  function stroke(points, thickness) {
    context.lineWidth = thickness;
    context.beginPath();
    points.forEach(([x, y], k) => k ? context.lineTo(x, y) : context.moveTo(x, y));
    context.stroke();
  }

  function leg(at, hip, side, { leg, foot, force }) {
    const radius = geometry.radius[side], eccentricity = geometry.eccentricity[side];
    const ax = hip[0] - geometry.leg * Math.sin(leg), ay = hip[1] - geometry.leg * Math.cos(leg);
    const cx = ax + eccentricity * Math.sin(foot), cy = ay + eccentricity * Math.cos(foot);
    context.strokeStyle = colour(side);
    context.lineCap = "round";
    stroke([at(...hip), at(ax, ay)], 6);
    if (side === "inner") {   // hollow: differs from the outer ones by more than its colour
      context.strokeStyle = colour("sky");
      stroke([at(...hip), at(ax, ay)], 2.5);
      context.strokeStyle = colour(side);
    }
    const sole = [];
    for (let k = 0; k <= 20; k++) {
      const direction = foot - (geometry.heel + (geometry.toe - geometry.heel) * k / 20);
      sole.push(at(cx - radius * Math.sin(direction), cy - radius * Math.cos(direction)));
    }
    stroke(sole, 4);
    if (force && Math.hypot(...force) > 1) {
      const low = [cx, cy - radius];
      context.strokeStyle = colour("hip");
      stroke([at(...low), at(low[0] + force[0] * FORCE_M_PER_N, low[1] + force[1] * FORCE_M_PER_N)], 2.5);
    }
    context.fillStyle = colour("paper");
    context.strokeStyle = colour(side);
    context.lineWidth = 2;
    context.beginPath();
    context.arc(...at(ax, ay), 4.5, 0, 2 * Math.PI);
    context.fill();
    context.stroke();
  }

  // What the picture shows.
  function words(values) {
    const { legs } = posed(values), lean = (angle) => `${Math.abs(angle).toFixed(2)} rad ${angle < 0 ? "back" : "forward"}`;
    if (!Number.isFinite(legs.outer.leg) || !Number.isFinite(legs.inner.leg)) return "its legs are not known";
    const on = ["outer", "inner"].filter((side) => legs[side].force && Math.hypot(...legs[side].force) > 1);
    return `outer legs lean ${lean(legs.outer.leg)}, inner legs ${lean(legs.inner.leg)}` + (on.length ? `, it stands on the ${on.join(" and ")} feet` : "");
  }

  return { draw, words, know: (hello) => { names = hello.pose; if (hello.geometry.leg) geometry = hello.geometry; } };
}
