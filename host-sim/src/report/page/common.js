"use strict";
// Numbers as the page writes them, and words beside the pointer.
const common = (() => {
  const superscript = (power) => [...String(power)].map((c) => c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[c]).join("");
  const number = (value) => {
    if (value === null || !Number.isFinite(value)) return "–";
    if (value === 0) return "0";
    const power = Math.floor(Math.log10(Math.abs(value)));
    const text = power < -4 || power > 5 ? (value / 10 ** power).toFixed(2) + "\u00a0×\u00a010" + superscript(power)
      : value.toFixed(Math.max(0, 2 - power));
    return text.replace("-", "−");
  };
  const box = document.getElementById("tip");
  const tip = {
    show: (event, lines) => {
      box.textContent = lines.join("\n");
      box.hidden = false;
      const { width, height } = box.getBoundingClientRect();
      const left = Math.min(event.clientX + 14, document.documentElement.clientWidth - width - 4);
      box.style.left = Math.max(4, left) + "px";
      box.style.top = Math.max(4, event.clientY - height - 10) + "px";
    },
    hide: () => { box.hidden = true; },
  };
  return { number, tip };
})();
