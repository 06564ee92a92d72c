// Draws the recorded walk. WALK: geometry {leg, radius {outer, inner}, eccentricity {outer, inner},
// heel, toe, slope} in m and rad,
// arrays t [s], state [lines of text], hip_x, hip_y [m], foot_outer, leg_outer, leg_inner, foot_inner [rad, absolute, positive
// leaning forward], currents [A] and the footholds {x, height}.
(function () {
  const canvas = document.getElementById("stage");
  const context = canvas.getContext("2d");
  const play = document.getElementById("play");
  const speed = document.getElementById("speed");
  const position = document.getElementById("position");
  const clock = document.getElementById("clock");
  const OUTER = "#1f6fb2", INNER = "#d9731a";
  const time = WALK.t, last = time.length - 1;
  const span = time[last] - time[0];
  let running = true, at = 0, previous = null;

  function index(seconds) {
    let low = 0, high = last;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (time[middle] - time[0] <= seconds) low = middle; else high = middle;
    }
    return low;
  }

  function leg(i, side, legAngle, footAngle, colour, scale, x0, ground) {
    const g = WALK.geometry;
    const radius = g.radius[side], eccentricity = g.eccentricity[side];
    const toX = (x) => (x - x0) * scale + canvas.width * 0.5;
    const toY = (y) => ground - y * scale;
    const hx = WALK.hip_x[i], hy = WALK.hip_y[i];
    const ax = hx - g.leg * Math.sin(legAngle), ay = hy - g.leg * Math.cos(legAngle);
    context.strokeStyle = colour;
    context.lineWidth = 7;
    context.lineCap = "round";
    context.beginPath();
    context.moveTo(toX(hx), toY(hy));
    context.lineTo(toX(ax), toY(ay));
    context.stroke();
    // the sole: an arc about the centre that lies `eccentricity` beyond the ankle
    const cx = ax + eccentricity * Math.sin(footAngle), cy = ay + eccentricity * Math.cos(footAngle);
    context.lineWidth = 5;
    context.beginPath();
    for (let k = 0; k <= 24; k++) {
      // point of the sole that touches level ground when the foot has rolled by `roll`
      const roll = g.heel + (g.toe - g.heel) * k / 24;
      const direction = footAngle - roll;
      const px = cx - radius * Math.sin(direction), py = cy - radius * Math.cos(direction);
      if (k === 0) context.moveTo(toX(px), toY(py)); else context.lineTo(toX(px), toY(py));
    }
    context.stroke();
    context.lineWidth = 2;
    context.beginPath();
    context.moveTo(toX(ax), toY(ay));
    context.lineTo(toX(cx - radius * Math.sin(footAngle)), toY(cy - radius * Math.cos(footAngle)));
    context.stroke();
    context.fillStyle = "#ffffff";
    context.beginPath();
    context.arc(toX(ax), toY(ay), 5, 0, 2 * Math.PI);
    context.fill();
    context.stroke();
  }

  function draw() {
    const i = index(at);
    const scale = canvas.height / 1.45;
    const ground = canvas.height - 46;
    const x0 = WALK.hip_x[i];
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.fillStyle = "#d5dde4";
    context.beginPath();
    context.moveTo(0, canvas.height);
    const half = canvas.width / 2 / scale;
    const heightAt = (x) => {
      let y = 0;
      for (const hold of WALK.footholds) { if (hold.x <= x) y = hold.height; else break; }
      return y;
    };
    for (let k = 0; k <= 200; k++) {
      const x = x0 - half + (2 * half) * k / 200;
      context.lineTo((x - x0) * scale + canvas.width / 2, ground - heightAt(x) * scale);
    }
    context.lineTo(canvas.width, canvas.height);
    context.fill();
    context.fillStyle = "#5b6875";
    context.font = "12px system-ui, sans-serif";
    for (let x = Math.ceil((x0 - half) * 2) / 2; x <= x0 + half; x += 0.5) {
      const px = (x - x0) * scale + canvas.width / 2;
      context.fillRect(px, ground + 4, 1, 8);
      context.fillText(x.toFixed(1) + " m", px + 4, ground + 22);
    }
    leg(i, "inner", WALK.leg_inner[i], WALK.foot_inner[i], INNER, scale, x0, ground);
    leg(i, "outer", WALK.leg_outer[i], WALK.foot_outer[i], OUTER, scale, x0, ground);
    context.fillStyle = "#1d2733";
    context.beginPath();
    context.arc(canvas.width / 2, ground - WALK.hip_y[i] * scale, 9, 0, 2 * Math.PI);
    context.fill();
    const bars = [["hip", WALK.hip_A[i], "#1d2733"], ["outer", WALK.outer_A[i], OUTER], ["inner", WALK.inner_A[i], INNER]];
    bars.forEach(([name, current, colour], k) => {
      const y = 40 + 30 * k;
      context.fillStyle = "#5b6875";
      context.fillText(name + " " + current.toFixed(2) + " A", 24, y - 6);
      context.fillStyle = colour;
      const width = current * 18;
      context.fillRect(width >= 0 ? 120 : 120 + width, y, Math.abs(width), 8);
    });
    context.fillStyle = "#1d2733";
    context.textAlign = "right";
    WALK.state[i].forEach((line, k) => context.fillText(line, canvas.width - 24, 34 + 18 * k));
    context.textAlign = "left";
    clock.textContent = time[i].toFixed(3) + " s";
    position.value = Math.round(1000 * at / span);
  }

  function tick(now) {
    if (running && previous !== null) {
      at += (now - previous) / 1000 * parseFloat(speed.value);
      if (at > span) at = 0;
    }
    previous = now;
    draw();
    window.requestAnimationFrame(tick);
  }
  play.onclick = () => { running = !running; play.textContent = running ? "Pause" : "Play"; };
  position.oninput = () => { at = position.value / 1000 * span; running = false; play.textContent = "Play"; draw(); };
  draw();
  window.requestAnimationFrame(tick);
  window.rangerWalk = { draw: draw, frames: last + 1 };
})();
