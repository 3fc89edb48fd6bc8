"use strict";
(() => {
  const show = () => {
    const target = document.getElementById(location.hash.slice(1));
    const folded = target && target.closest("details");
    if (!folded) return;
    folded.open = true;
    target.scrollIntoView({ block: "center", inline: "center" });
  };
  window.addEventListener("hashchange", show);
  show();
})();
(() => {
  const form = document.querySelector(".time");
  if (!form) return;
  const [slider, output] = [form.querySelector("input"), form.querySelector("output")];
  const names = [...document.querySelectorAll(".moments li")].map((each) => each.textContent);
  const groups = [...document.querySelectorAll("[data-moment]")];
  const show = () => {
    for (const each of groups) each.toggleAttribute("hidden", each.dataset.moment !== slider.value);
    output.value = names[slider.value];
    slider.setAttribute("aria-valuetext", names[slider.value]);
  };
  slider.addEventListener("input", show);
  form.hidden = false;
  document.querySelector(".at").hidden = true;
  show();
})();
