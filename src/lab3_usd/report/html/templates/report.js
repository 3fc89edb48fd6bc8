"use strict";
(() => {
  const tools = document.getElementById("tools");
  const all = (query, within = document) => [...within.querySelectorAll(query)];
  const cards = all(".card");
  const texts = new Map(cards.map((card) => [card, card.textContent.toLowerCase()]));
  const output = tools.querySelector("output");
  const has = (element, stage) => !stage || element.dataset.in.split(" ").includes(stage);

  function filter() {
    const severities = new Set(all("[name=severity]:checked", tools).map((box) => box.value));
    const stage = tools.elements.stage ? tools.elements.stage.value : "";
    const words = tools.elements.words.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const card of cards) {
      const fits =
        severities.has(card.dataset.severity) &&
        has(card, stage) &&
        words.every((word) => texts.get(card).includes(word));
      card.hidden = !fits;
      shown += fits;
    }
    for (const group of all(".section, .chapter, .rank")) {
      group.hidden = !group.querySelector(".card:not([hidden])");
    }
    for (const part of all(".findings")) {
      const inside = all(".card", part);
      part.querySelector(".nothing").hidden = !inside.length || inside.some((card) => !card.hidden);
    }
    for (const element of all("figure[data-in], tr[data-in]")) {
      element.hidden = !has(element, stage);
    }
    const filtered = shown < cards.length || stage;
    tools.classList.toggle("filtered", Boolean(filtered));
    output.value = filtered ? `${shown} of ${cards.length}` : "";
  }

  function show(id) {
    const target = id && document.getElementById(id);
    if (!target) return;
    if (target.closest("[hidden]")) {
      tools.reset();
      filter();
    }
    const details = target.closest("details");
    if (details) details.open = true;
    for (const lit of all(".lit")) lit.classList.remove("lit");
    if (target.closest("svg")) target.classList.add("lit");
    target.scrollIntoView({ block: "center", inline: "center" });
    if (target.hasAttribute("tabindex")) target.focus({ preventScroll: true });
  }

  for (const picture of all(".picture")) {
    const drawn = picture.querySelector("svg");
    const share = picture.clientWidth / drawn.width.baseVal.value;
    if (share >= 1) continue;
    const button = document.createElement("button");
    const hint = document.createElement("small");
    button.type = "button";
    hint.textContent = "wider than the page: scroll sideways";
    const fit = (on) => {
      picture.classList.toggle("fit", on);
      button.textContent = on ? "Full size" : "Fit to width";
      hint.hidden = on;
    };
    button.addEventListener("click", () => fit(!picture.classList.contains("fit")));
    picture.parentElement.querySelector("figcaption").append(hint, button);
    fit(share >= 0.75); // the smallest text is 11 pixels high in full size
  }

  tools.hidden = cards.length < 2 && !tools.elements.stage;
  tools.addEventListener("input", filter);
  tools.addEventListener("change", filter);
  tools.addEventListener("submit", (event) => event.preventDefault());
  tools.addEventListener("reset", () => setTimeout(filter));
  document.addEventListener("click", (event) => {
    const link = event.target.closest("a[href^='#']");
    if (!link) return;
    if (link.dataset.stage !== undefined && tools.elements.stage) {
      tools.elements.stage.value = link.dataset.stage;
      filter();
    }
    const id = link.getAttribute("href").slice(1);
    // The address may be the same as before: then no event tells that it was asked for again.
    setTimeout(() => show(id));
  });
  window.addEventListener("hashchange", () => show(location.hash.slice(1)));
  window.addEventListener("beforeprint", () => {
    for (const details of all("details")) details.open = true;
  });
  filter();
  show(location.hash.slice(1));
})();
