// Searches the pages in the browser alone: search.html works from the disk too, where MkDocs' own search may not load its index.
"use strict";
(() => {
  const MOST = 20, CONTEXT = 80, SHORTEST = 2;
  const TITLE_WEIGHT = 20;
  const box = document.getElementById("mkdocs-search-query");
  const list = document.getElementById("mkdocs-search-results");
  if (!box || !list) return;

  const count = (text, word) => text.split(word).length - 1;
  const score = (entry, words) => {
    const title = entry.title.toLowerCase(), text = entry.text.toLowerCase();
    const scores = words.map((word) => TITLE_WEIGHT * count(title, word) + Math.min(count(text, word), TITLE_WEIGHT - 1));
    return scores.every((one) => one > 0) ? scores.reduce((sum, one) => sum + one, 0) : 0;
  };
  const extract = (text, words) => {
    const place = Math.max(0, ...words.map((word) => text.toLowerCase().indexOf(word)));
    const start = Math.max(0, place - CONTEXT), end = Math.min(text.length, place + CONTEXT);
    return `${start ? "... " : ""}${text.slice(start, end)}${end < text.length ? " ..." : ""}`;
  };
  const article = (entry, words) => {
    const found = document.createElement("article"), head = document.createElement("h3");
    const link = document.createElement("a"), words_around = document.createElement("p");
    link.href = entry.location;
    link.textContent = entry.title;
    words_around.textContent = extract(entry.text, words);
    head.append(link);
    found.append(head, words_around);
    return found;
  };
  const search = () => {
    const words = box.value.toLowerCase().split(/\s+/).filter((word) => word.length >= SHORTEST);
    const found = words.length === 0 ? [] : window.searchIndex.docs
      .map((entry) => [score(entry, words), entry])
      .filter(([points]) => points > 0)
      .sort((one, other) => other[0] - one[0])
      .slice(0, MOST);
    list.replaceChildren(...found.map(([, entry]) => article(entry, words)));
    if (found.length === 0) list.textContent = words.length ? "No page has all of these words." : "Type one word or more.";
  };

  const index = document.createElement("script");
  index.src = "search/search_index.js";
  index.addEventListener("load", () => {
    box.value = new URLSearchParams(window.location.search).get("q") || box.value;
    box.addEventListener("input", search);
    box.form.addEventListener("submit", (event) => event.preventDefault());
    search();
  });
  document.head.append(index);
})();
