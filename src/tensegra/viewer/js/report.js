// Opens each viewer of a page where its scene stands.
for (const host of document.querySelectorAll("[data-tensegra-scene]")) {
  const still = host.querySelector("img, svg, noscript");
  const open = () => {
    const content = JSON.parse(document.getElementById(host.dataset.tensegraScene).textContent);
    const box = document.createElement("div");
    host.prepend(box);
    if (still) still.style.display = "none"; // a page's own style may show what is hidden
    host.viewer = mount(box, content);
  };
  // A browser has few WebGL contexts: a viewer opens as it comes into sight.
  new IntersectionObserver((seen, watcher) => {
    if (seen.some((entry) => entry.isIntersecting)) { watcher.disconnect(); open(); }
  }, { rootMargin: "200px" }).observe(host);
}
