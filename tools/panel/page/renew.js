// Elements of the page, and bringing them up to date without replacing them: the focus, a selection and the place of a
// screen reader stay where they are, and nothing is announced again that is the same.

export const by = (id) => document.getElementById(id);

export function put(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

// `wanted` is what `box` has then; nodes of the same kind at the same place are kept and made alike.
export function renew(box, ...wanted) {
  wanted.forEach((fresh, k) => {
    const old = box.childNodes[k];
    if (old) adapt(old, fresh);
    else box.append(fresh);
  });
  while (box.childNodes.length > wanted.length) box.lastChild.remove();
}

function adapt(old, fresh) {
  if (old.nodeName !== fresh.nodeName) { old.replaceWith(fresh); return; }
  if (old.nodeType === Node.TEXT_NODE) {
    if (old.data !== fresh.data) old.data = fresh.data;
    return;
  }
  for (const name of old.getAttributeNames()) if (name !== "tabindex" && !fresh.hasAttribute(name)) old.removeAttribute(name);
  for (const { name, value } of fresh.attributes) if (old.getAttribute(name) !== value) old.setAttribute(name, value);
  old.onclick = fresh.onclick;
  renew(old, ...fresh.childNodes);
}

// What is wider than its place can be scrolled by the keyboard: it is reached by Tab as long as it is.
export function reachable(view) {
  for (const box of view.querySelectorAll(".scroll")) {
    if (box.scrollWidth > box.clientWidth) box.tabIndex = 0;
    else box.removeAttribute("tabindex");
  }
}
