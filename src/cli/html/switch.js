"use strict";
// Without it the pictures stand one below the other.
const shots = [...document.querySelectorAll(".stack figure")], tabs = document.createElement("p");
let shown = 0;
const show = n => {
  shown = n;
  shots.forEach((shot, i) => shot.hidden = i !== n);
  [...tabs.children].forEach((tab, i) => tab.setAttribute("aria-pressed", i === n));
};
const flip = () => show(shown === 0 ? 1 : 0);
shots.forEach((shot, i) => {
  const tab = document.createElement("button"), image = shot.querySelector("img");
  tab.textContent = `${i + 1} ${image.alt}`;
  tab.onclick = () => show(i);
  tabs.append(tab);
  image.onclick = flip;
});
document.querySelector(".stack").before(tabs);
addEventListener("keydown", event => {
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  if (event.key.toLowerCase() === "f") flip();
  else if (event.key - 1 in shots) show(event.key - 1);
});
show(0);
