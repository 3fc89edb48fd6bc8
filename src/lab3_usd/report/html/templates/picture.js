"use strict";
// Pictures zoom by their width: what does not fit is reached by scrolling or dragging.
(() => {
  const MOST = 4; // times full size
  const LEAST = 0.75; // the smallest text is 11 pixels high in full size
  const STEP = 1.25;

  function start(picture) {
    const drawn = picture.querySelector("svg");
    const width = drawn.width.baseVal.value;
    const name = picture.getAttribute("aria-label");
    const share = () => Math.min(1, picture.clientWidth / width);
    let scale = 1;

    // The point at (x, y) of the window onto the picture stays where it is.
    function zoom(to, x = picture.clientWidth / 2, y = picture.clientHeight / 2) {
      const before = drawn.getBoundingClientRect().width;
      const [left, top] = [picture.scrollLeft + x, picture.scrollTop + y];
      scale = Math.min(Math.max(to, share()), MOST);
      const fits = scale <= share();
      picture.classList.toggle("fit", fits);
      picture.classList.toggle("scrolls", !fits);
      picture.classList.toggle("zoomed", scale > 1);
      drawn.style.width = fits ? "" : `${width * scale}px`;
      const grown = drawn.getBoundingClientRect().width / before;
      picture.scrollTo(left * grown - x, top * grown - y);
      hint.hidden = fits;
      whole.textContent = fits ? "Full size" : "Fit to width";
      whole.hidden = fits && share() === 1;
    }

    function button(text, label, action) {
      const made = document.createElement("button");
      made.type = "button";
      made.textContent = text;
      if (label) made.setAttribute("aria-label", `${label}: ${name}`);
      made.addEventListener("click", action);
      return made;
    }

    const hint = document.createElement("small");
    hint.textContent = "drag or scroll to see the rest";
    const whole = button("", "", () => zoom(picture.classList.contains("fit") ? 1 : 0));
    const tools = document.createElement("span");
    tools.className = "zoom";
    tools.append(
      whole,
      button("\u2212", "Zoom out", () => zoom(scale / STEP)),
      button("+", "Zoom in", () => zoom(scale * STEP)),
    );
    picture.closest("figure").querySelector("figcaption").append(hint, tools);

    picture.addEventListener("keydown", (event) => {
      const to = { "+": scale * STEP, "=": scale * STEP, "-": scale / STEP, 0: share() }[event.key];
      if (!to || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      zoom(to);
    });
    picture.addEventListener(
      "wheel",
      (event) => {
        if (!event.ctrlKey) return;
        event.preventDefault();
        const frame = picture.getBoundingClientRect();
        const to = event.deltaY < 0 ? scale * STEP : scale / STEP;
        zoom(to, event.clientX - frame.x, event.clientY - frame.y);
      },
      { passive: false },
    );

    let from = null; // where a drag began
    picture.addEventListener("pointerdown", (event) => {
      // Fingers scroll by themselves.
      if (event.pointerType !== "mouse" || event.button || !picture.matches(".scrolls")) return;
      from = { x: event.clientX, y: event.clientY, left: picture.scrollLeft, top: picture.scrollTop };
    });
    picture.addEventListener("pointermove", (event) => {
      if (!from) return;
      const [x, y] = [event.clientX - from.x, event.clientY - from.y];
      if (!picture.classList.contains("dragged")) {
        if (Math.hypot(x, y) < 5) return;
        picture.classList.add("dragged");
        picture.setPointerCapture(event.pointerId);
      }
      picture.scrollTo(from.left - x, from.top - y);
    });
    for (const end of ["pointerup", "pointercancel"]) {
      picture.addEventListener(end, () => {
        from = null;
        setTimeout(() => picture.classList.remove("dragged"));
      });
    }
    picture.addEventListener("dragstart", (event) => event.preventDefault());
    picture.addEventListener(
      "click",
      (event) => picture.classList.contains("dragged") && event.preventDefault(),
      true,
    );

    window.addEventListener("resize", () => zoom(picture.classList.contains("fit") ? 0 : scale));
    zoom(share() < LEAST && picture.matches(".picture") ? 1 : 0);
    const fault = drawn.querySelector("a");
    if (!fault) return;
    const [place, frame] = [fault.getBoundingClientRect(), picture.getBoundingClientRect()];
    picture.scrollLeft += place.x + place.width / 2 - frame.x - frame.width / 2;
  }

  for (const picture of document.querySelectorAll(".picture, .zooming")) {
    const folded = picture.closest("details");
    if (!folded || folded.open) start(picture);
    else folded.addEventListener("toggle", () => start(picture), { once: true });
  }
})();
