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
for (const form of document.querySelectorAll(".time")) {
  const section = form.closest("section");
  const [slider, output] = [form.querySelector("input"), form.querySelector("output")];
  const button = form.querySelector("button");
  const moments = [...section.querySelectorAll(".moments li")];
  const names = moments.map((each) => each.textContent);
  const now = document.querySelector(`[data-motion="${section.dataset.play}"] .now`);
  const groups = [...section.querySelectorAll("[data-moment]")];
  const show = () => {
    for (const each of groups) each.toggleAttribute("hidden", each.dataset.moment !== slider.value);
    output.value = names[slider.value];
    slider.setAttribute("aria-valuetext", names[slider.value]);
    if (!now) return;
    now.removeAttribute("hidden");
    now.setAttribute("transform", `translate(${moments[slider.value].dataset.place})`);
  };
  let coming = 0; // the next moment while it plays
  const stop = () => {
    clearTimeout(coming);
    coming = 0;
    button.textContent = "Play";
  };
  // In the time of the run.
  const play = () => {
    const [at, last] = [Number(slider.value), moments.length - 1];
    if (at === last) return stop();
    const wait = moments[at + 1].dataset.at - moments[at].dataset.at;
    coming = setTimeout(() => {
      slider.value = at + 1;
      show();
      play();
    }, 1000 * wait);
  };
  button.addEventListener("click", () => {
    if (coming) return stop();
    if (Number(slider.value) === moments.length - 1) slider.value = 0;
    button.textContent = "Pause";
    show();
    play();
  });
  slider.addEventListener("input", () => {
    stop();
    show();
  });
  form.hidden = false;
  section.querySelector(".at").hidden = true;
  show();
}
