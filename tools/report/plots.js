// Unpacks the library and draws each figure of the page from the numbers next to it.
(async function () {
  "use strict";
  const complaint = document.getElementById("no-plots");
  if (!("DecompressionStream" in window)) {
    complaint.hidden = false;
    return;
  }
  const letters = atob(document.getElementById("packed-plotly").textContent);
  const bytes = Uint8Array.from(letters, (letter) => letter.charCodeAt(0));
  const library = document.createElement("script");
  library.textContent = await new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  document.head.append(library);
  for (const numbers of document.querySelectorAll("script.figure")) {
    const figure = JSON.parse(numbers.textContent);
    const how = { displaylogo: false, displayModeBar: false, responsive: true };
    await Plotly.newPlot(numbers.previousElementSibling, figure.data, figure.layout, how);
  }
  document.documentElement.dataset.plots = "drawn";
})();
