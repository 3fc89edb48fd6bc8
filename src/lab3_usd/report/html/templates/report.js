"use strict";
(() => {
  const tools = document.getElementById("tools");
  const all = (query, within = document) => [...within.querySelectorAll(query)];
  const cards = all(".card");
  const lists = [".stages", ".crashes ul", ".unknown ul", ".checks", ".legs"];
  const units = all(`figure, tbody tr, :is(${lists}) > li, .rules article`);
  const texts = new Map(
    [...cards, ...units].map((element) => [element, element.textContent.toLowerCase()]),
  );
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
    for (const element of units) {
      const fits = words.every((word) => texts.get(element).includes(word));
      element.hidden = !fits || (element.dataset.in !== undefined && !has(element, stage));
    }
    for (const list of all(".checks")) {
      list.hidden = list.previousElementSibling.hidden = !list.querySelector("li:not([hidden])");
    }
    for (const part of all(".block > section:not(.findings), .rules")) {
      const inside = units.filter((element) => part.contains(element));
      part.hidden = words.length > 0 && inside.every((element) => element.hidden);
    }
    const filtered = shown < cards.length || stage || words.length;
    tools.classList.toggle("filtered", Boolean(filtered));
    output.value = filtered ? `${shown} of ${cards.length} findings` : "";
  }

  // The filter is in the address, where no finding is: as what a form would send.
  function keep() {
    const values = new URLSearchParams();
    for (const box of all("[name=severity]:not(:checked)", tools)) values.append("without", box.value);
    for (const name of ["stage", "words"]) {
      const value = tools.elements[name] && tools.elements[name].value;
      if (value) values.append(name, value);
    }
    history.replaceState(null, "", `#${values}`);
  }

  function open() {
    const address = location.hash.slice(1);
    if (!address.includes("=")) return show(address);
    const values = new URLSearchParams(address);
    for (const box of all("[name=severity]", tools)) {
      box.checked = !values.getAll("without").includes(box.value);
    }
    if (tools.elements.stage) tools.elements.stage.value = values.get("stage") || "";
    tools.elements.words.value = values.get("words") || "";
    filter();
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
    const block = target.matches("section, figure") ? "start" : "center";
    target.scrollIntoView({ block, inline: "center" });
    if (target.hasAttribute("tabindex")) target.focus({ preventScroll: true });
  }

  for (const code of navigator.clipboard ? all(".site code, .card dd code, .command code") : []) {
    const text = code.textContent;
    if (text.includes(" ") && !code.closest(".command")) continue; // words, not a path
    const button = document.createElement("button");
    button.type = "button";
    button.className = "copy";
    button.textContent = "Copy";
    button.setAttribute("aria-label", `Copy ${text}`);
    button.addEventListener("click", async () => {
      await navigator.clipboard.writeText(text);
      button.textContent = "Copied";
      setTimeout(() => (button.textContent = "Copy"), 2000);
    });
    code.after(button);
  }

  tools.hidden = cards.length < 2 && !tools.elements.stage;
  for (const kind of ["input", "change"]) {
    tools.addEventListener(kind, () => {
      filter();
      keep();
    });
  }
  tools.addEventListener("submit", (event) => event.preventDefault());
  tools.addEventListener("reset", () => setTimeout(filter));
  tools.querySelector("[type=reset]").addEventListener("click", () => setTimeout(keep));
  document.addEventListener("click", (event) => {
    const link = event.target.closest("a[href^='#']");
    if (!link) return;
    if (link.dataset.stage !== undefined && tools.elements.stage) {
      tools.elements.stage.value = link.dataset.stage;
      filter();
      keep();
    }
    const id = link.getAttribute("href").slice(1);
    // The address may be the same as before: then no event tells that it was asked for again.
    setTimeout(() => show(id));
  });
  window.addEventListener("hashchange", open);
  window.addEventListener("beforeprint", () => {
    for (const details of all("details")) details.open = true;
  });
  filter();
  open();
})();
