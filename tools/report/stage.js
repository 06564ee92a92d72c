// Draws the robot at one time of the recorded walk, sharp on any screen.
// walk: series [rad, absolute, positive leaning forward; m], geometry {leg, radius {outer, inner}, eccentricity {outer,
// inner}, heel, toe} in m and rad, footholds {x, height} in m. colour(name): of the page's style.
function makeStage(canvas, walk, colour) {
  const context = canvas.getContext("2d");
  const series = walk.series, g = walk.geometry;
  const SEEN_M = 1.35;      // height of the picture: the hip is at 1.01 m
  const BELOW_PX = 34;      // of the floor, with its scale
  let width = 0, height = 0;

  function resize() {
    const ratio = window.devicePixelRatio || 1;
    width = canvas.clientWidth;
    height = canvas.clientHeight;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
  }

  function view(i) {
    const scale = (height - BELOW_PX) / (SEEN_M - 0.1), x0 = series.hip_x_m[i], ground = height - BELOW_PX;
    return { scale, x0, ground, half: width / 2 / scale,
             x: (metres) => (metres - x0) * scale + width / 2, y: (metres) => ground - metres * scale };
  }

  function floor(v) {
    const heightAt = (x) => {
      let y = 0;
      for (const hold of walk.footholds) { if (hold.x <= x) y = hold.height; else break; }
      return y;
    };
    context.fillStyle = colour("floor");
    context.beginPath();
    context.moveTo(0, height);
    for (let k = 0; k <= 200; k++) {
      const metres = v.x0 - v.half + 2 * v.half * k / 200;
      context.lineTo(v.x(metres), v.y(heightAt(metres)));
    }
    context.lineTo(width, height);
    context.fill();
    context.fillStyle = colour("soft");
    context.font = "12px system-ui, sans-serif";
    for (let metres = Math.ceil((v.x0 - v.half) * 2) / 2; metres <= v.x0 + v.half; metres += 0.5) {
      context.fillRect(v.x(metres), v.ground + 4, 1, 8);
      context.fillText(metres.toFixed(1) + " m", v.x(metres) + 4, v.ground + 22);
    }
  }

  function stroke(points, thickness) {
    context.lineWidth = thickness;
    context.beginPath();
    points.forEach(([x, y], k) => k === 0 ? context.moveTo(x, y) : context.lineTo(x, y));
    context.stroke();
  }

  function leg(v, side, hip, legAngle, footAngle) {
    const radius = g.radius[side], eccentricity = g.eccentricity[side];
    const at = (x, y) => [v.x(x), v.y(y)];
    const ax = hip[0] - g.leg * Math.sin(legAngle), ay = hip[1] - g.leg * Math.cos(legAngle);
    context.strokeStyle = colour(side);
    context.lineCap = "round";
    stroke([at(...hip), at(ax, ay)], 7);
    // the sole: an arc about the centre that lies `eccentricity` beyond the ankle
    const cx = ax + eccentricity * Math.sin(footAngle), cy = ay + eccentricity * Math.cos(footAngle);
    const sole = [];
    for (let k = 0; k <= 24; k++) {
      // point of the sole that touches level ground when the foot has rolled so far
      const direction = footAngle - (g.heel + (g.toe - g.heel) * k / 24);
      sole.push(at(cx - radius * Math.sin(direction), cy - radius * Math.cos(direction)));
    }
    stroke(sole, 5);
    stroke([at(ax, ay), at(cx - radius * Math.sin(footAngle), cy - radius * Math.cos(footAngle))], 2);
    context.fillStyle = colour("paper");
    context.beginPath();
    context.arc(...at(ax, ay), 5, 0, 2 * Math.PI);
    context.fill();
    context.stroke();
  }

  function draw(i) {
    const v = view(i), hip = [series.hip_x_m[i], series.hip_y_m[i]];
    context.clearRect(0, 0, width, height);
    floor(v);
    leg(v, "inner", hip, series.leg_inner_rad[i], series.foot_inner_rad[i]);
    leg(v, "outer", hip, series.leg_outer_rad[i], series.foot_outer_rad[i]);
    context.fillStyle = colour("ink");
    context.beginPath();
    context.arc(v.x(hip[0]), v.y(hip[1]), 9, 0, 2 * Math.PI);
    context.fill();
  }

  return { draw, resize };
}
