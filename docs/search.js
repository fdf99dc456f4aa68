// The search of the manual: whole words of any length (TA, TN, Ms), also where the pages are opened from files.
// search/index.js, which docs/hooks.py writes, says `var searched = [{title, text, location}, …]`; terms come first.
"use strict";

const MOST = 40;

function patterns(word) {
  const plain = word.replace(/[.*+?^${}()|[\]\\/-]/g, "\\$&");
  const begin = `(?<![\\p{L}\\p{N}])${plain}`, whole = `${begin}(?![\\p{L}\\p{N}])`;
  // as it is written, in any case, as the beginning of a longer word: TA before Ta before table
  return [new RegExp(whole, "u"), new RegExp(whole, "iu"), ...(word.length > 2 ? [new RegExp(begin, "iu")] : [])];
}

function worth(entry, words) {
  let sum = 0;
  for (const each of words) {
    const title = each.findIndex((one) => one.test(entry.title)), text = each.findIndex((one) => one.test(entry.text));
    if (title < 0 && text < 0) return 0;
    sum += (title < 0 ? 0 : 30 / (title + 1)) + (text < 0 ? 0 : 3 / (text + 1));
    if (title >= 0 && entry.title.search(each[title]) === 0) sum += 30 / (title + 1);
  }
  return sum;
}

function around(text, words) {
  if (text.length <= 180) return text;
  const places = words.map((each) => text.search(each.find((one) => one.test(text)) ?? /$^/)).filter((at) => at >= 0);
  const from = text.lastIndexOf(" ", Math.max(0, Math.min(...places, text.length) - 60)) + 1;
  return `${from ? "… " : ""}${text.slice(from, text.indexOf(" ", from + 180) + 1 || text.length)}…`;
}

function shown(found, words) {
  const article = document.createElement("article"), head = document.createElement("h3");
  const link = document.createElement("a"), text = document.createElement("p");
  const page = document.createElement("small");
  link.href = `${base_url}/${found.location}`;
  link.textContent = found.title;
  text.textContent = around(found.text, words);
  page.textContent = ` ${found.location.split(".html")[0]}`;
  head.append(link, page);
  article.append(head, text);
  return article;
}

function search(query, place) {
  const words = query.trim().split(/\s+/).filter(Boolean).map(patterns);
  const rated = words.length ? searched.map((entry) => [worth(entry, words), entry]).filter(([rate]) => rate) : [];
  rated.sort(([one], [other]) => other - one);
  const said = document.createElement("p");
  said.setAttribute("role", "status");
  const count = rated.length > MOST ? `${rated.length} places, the nearest ${MOST}` : `${rated.length} places`;
  said.textContent = !words.length ? "" : rated.length ? count : place.dataset.noResultsText;
  place.replaceChildren(said, ...rated.slice(0, MOST).map(([, entry]) => shown(entry, words)));
}

document.addEventListener("DOMContentLoaded", () => {
  const query = document.getElementById("mkdocs-search-query");
  const place = document.getElementById("mkdocs-search-results");
  let loading = false;
  function asked() {
    if (typeof searched !== "undefined") return search(query.value, place);
    if (loading) return undefined;
    loading = true;
    const script = document.createElement("script");  // a script may be read from a file, other data may not
    script.src = `${base_url}/search/index.js`;
    script.onload = asked;
    return document.head.append(script);
  }
  query.addEventListener("focus", asked);
  query.addEventListener("input", asked);
  query.form?.addEventListener("submit", (event) => event.preventDefault());
  const given = new URLSearchParams(window.location.search).get("q");
  if (given) { query.value = given; asked(); }
});
