"use strict";
// Shows the table's row of the point that the pointer or the focus is on. Words only ever go in as text.
const box = document.getElementById("details");
const names = [...document.querySelectorAll("thead th")].map((th) => th.textContent);
let shown = null;
let pinned = false;

function row(target) {
  return document.getElementById("point-" + target.dataset.point);
}

function fill(target) {
  const cells = [...row(target).cells].map((td) => td.textContent);
  box.querySelector("h2").textContent = cells.slice(1, 6).join(" ") + (cells[0] ? " (on the front)" : "");
  const list = box.querySelector("dl");
  list.replaceChildren();
  for (let i = 6; i < cells.length - 1; i += 1) {
    const name = document.createElement("dt");
    const value = document.createElement("dd");
    name.textContent = names[i];
    value.textContent = cells[i];
    list.append(name, value);
  }
  box.querySelector("code").textContent = cells[cells.length - 1];
  box.querySelector("button").textContent = "copy";
}

// Beside the point, on the side where there is more room.
function move(target) {
  const point = target.getBoundingClientRect();
  const size = box.getBoundingClientRect();
  const wide = document.documentElement.clientWidth;
  const high = document.documentElement.clientHeight;
  const x = point.right + 6 + size.width < wide ? point.right + 6 : point.left - 6 - size.width;
  const y = point.top + size.height < high ? point.top : high - size.height - 6;
  box.style.left = Math.max(4, Math.min(x, wide - size.width - 4)) + "px";
  box.style.top = Math.max(4, y) + "px";
}

function hide() {
  if (shown !== null) {
    shown.classList.remove("shown");
    row(shown).classList.remove("shown");
  }
  shown = null;
  pinned = false;
  box.hidden = true;
}

function show(target) {
  if (shown !== target) {
    hide();
    shown = target;
    target.classList.add("shown");
    row(target).classList.add("shown");
    fill(target);
    box.hidden = false;
  }
  move(target);
}

function pin(target) {
  show(target);
  pinned = true;
}

// Where the clipboard may not be written, the command is selected instead.
function copy() {
  const code = box.querySelector("code");
  const button = box.querySelector("button");
  const select = () => {
    getSelection().selectAllChildren(code);
    const copied = document.execCommand("copy");
    button.textContent = copied ? "copied" : "selected";
  };
  if (navigator.clipboard) {
    navigator.clipboard.writeText(code.textContent).then(() => { button.textContent = "copied"; }, select);
  } else {
    select();
  }
}

for (const target of document.querySelectorAll(".target")) {
  target.addEventListener("pointerenter", () => { if (!pinned) show(target); });
  target.addEventListener("pointerleave", () => { if (!pinned) hide(); });
  target.addEventListener("focus", () => show(target));
  target.addEventListener("click", (event) => { event.stopPropagation(); pin(target); });
  target.addEventListener("keydown", (event) => {
    if (event.key === "Enter" || event.key === " ") {
      event.preventDefault();
      pin(target);
      box.querySelector("button").focus();
    }
  });
}
box.addEventListener("click", (event) => event.stopPropagation());
box.querySelector("button").addEventListener("click", copy);
document.addEventListener("click", hide);
document.addEventListener("keydown", (event) => {
  if (event.key !== "Escape" || shown === null) return;
  const target = shown;
  hide();
  target.focus();
  hide();
});
addEventListener("scroll", () => { if (shown !== null) move(shown); }, { passive: true });
