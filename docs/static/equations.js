document.addEventListener("DOMContentLoaded", () => {
  for (const place of document.querySelectorAll(".equation")) {
    const displayMode = place.tagName === "DIV";
    katex.render(place.textContent, place, { displayMode, throwOnError: false });
  }
});
