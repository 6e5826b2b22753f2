/** In the page: drawings a second for so many seconds, and within what time (ms) 99 % of them follow the one before. */
export function drawnIn(seconds) {
  return new Promise((resolve) => {
    const times = [];
    const end = performance.now() + seconds * 1000;
    const draw = (now) => {
      times.push(now);
      if (performance.now() < end) return requestAnimationFrame(draw);
      const gaps = times.slice(1).map((time, i) => time - times[i]);
      const sorted = [...gaps].sort((a, b) => a - b);
      const whole = times[times.length - 1] - times[0];
      resolve({ drawn: (gaps.length / whole) * 1000, p99: sorted[Math.floor(sorted.length * 0.99)] });
    };
    requestAnimationFrame(draw);
  });
}
