// Everything beside the table: choices, sliders and the read-out.

const LIMITS = {
  mass: { name: "mass", unit: "kg", min: 0.5, max: 2, step: 0.01, digits: 2 },
  radius: { name: "radius", unit: "mm", min: 40, max: 75, step: 0.5, digits: 1 },
  friction: { name: "friction", unit: "", min: 0.03, max: 0.4, step: 0.005, digits: 3 },
};

export function byId(id) {
  return document.getElementById(id);
}

function written(value, { unit, digits }) {
  return `${value.toFixed(digits)}${unit ? ` ${unit}` : ""}`;
}

export function choose(name, value) {
  const input = document.querySelector(`input[name="${name}"][value="${CSS.escape(String(value))}"]`);
  if (input) input.checked = true;
}

export function chosen(name) {
  return document.querySelector(`input[name="${name}"]:checked`)?.value;
}

export class Sliders {
  constructor(onChange) {
    this.onChange = onChange;
  }

  show(view) {
    if (this.count !== view.disks.length) this.make(view.disks.length);
    view.disks.forEach((disk, index) => {
      this.set(`mass-${index + 1}`, disk.mass_kg, LIMITS.mass);
      this.set(`radius-${index + 1}`, disk.radius_mm, LIMITS.radius);
    });
    this.set("table-friction", view.table_friction, LIMITS.friction);
    byId("hidden-properties").hidden = view.has_own_properties;
  }

  make(count) {
    this.count = count;
    const rows = byId("sliders");
    rows.replaceChildren();
    for (let disk = 1; disk <= count; disk += 1) {
      this.add(rows, `mass-${disk}`, `Disk ${disk}, mass`, LIMITS.mass);
      this.add(rows, `radius-${disk}`, `Disk ${disk}, radius`, LIMITS.radius);
    }
    this.add(rows, "table-friction", "Table, friction", LIMITS.friction);
  }

  add(rows, id, text, limit) {
    const label = document.createElement("label");
    const name = document.createElement("span");
    const input = document.createElement("input");
    const output = document.createElement("output");
    name.textContent = text;
    Object.assign(input, { type: "range", id, min: limit.min, max: limit.max, step: limit.step });
    output.htmlFor = id;
    label.append(name, input, output);
    rows.append(label);
    input.addEventListener("input", () => this.write(input, limit, Number(input.value)));
    input.addEventListener("change", () => this.onChange(this.values()));
  }

  set(id, value, limit) {
    const input = byId(id);
    if (document.activeElement === input && input.matches(":active")) return;
    input.value = value;
    this.write(input, limit, value);
  }

  write(input, limit, value) {
    input.exact = value; // the slider itself holds a multiple of its step
    const text = written(value, limit);
    input.nextElementSibling.textContent = text;
    input.setAttribute("aria-valuetext", text);
    const share = (100 * (input.value - limit.min)) / (limit.max - limit.min);
    input.style.setProperty("--done", `${share}%`);
  }

  values() {
    const numbers = Array.from({ length: this.count }, (_, index) => index + 1);
    return {
      mass_kg: numbers.map((disk) => byId(`mass-${disk}`).exact),
      radius_mm: numbers.map((disk) => byId(`radius-${disk}`).exact),
      table_friction: byId("table-friction").exact,
    };
  }
}

export class Readout {
  constructor(models) {
    this.models = models;
    this.head = byId("readout-head");
  }

  show(ghosts) {
    const disks = ghosts.reference.length;
    if (this.disks !== disks) this.makeHead(disks);
    const label = this.models.find(({ name }) => name === ghosts.against)?.label;
    byId("readout-title").textContent = ghosts.against === "world"
      ? "Errors of the predictions, for the executed push"
      : `Differences from ${label}, for this push`;
    ghosts.ghosts.forEach((ghost) => {
      const { id } = this.models.find(({ name }) => name === ghost.model);
      const row = byId(`row-${id}`);
      const isReference = ghost.model === ghosts.against;
      while (row.cells.length > 1) row.deleteCell(-1);
      ghost.difference_mm.forEach((mm, index) => {
        const cell = row.insertCell();
        // A line may break between the two.
        cell.append(...(isReference ? ["–"] : [
          whole(`${number(mm)} mm,`), " ", whole(`${number(ghost.difference_deg[index])}°`),
        ]));
      });
    });
    const notes = [...ghosts.warnings];
    byId("doubts").textContent = notes.map(sentence).join(" ");
  }

  makeHead(disks) {
    this.disks = disks;
    while (this.head.cells.length > 1) this.head.deleteCell(-1);
    for (let disk = 1; disk <= disks; disk += 1) {
      const cell = document.createElement("th");
      cell.scope = "col";
      cell.textContent = `disk ${disk}`;
      this.head.append(cell);
    }
  }

  clear(text) {
    byId("readout-title").textContent = text;
    this.models.forEach(({ id }) => {
      const row = byId(`row-${id}`);
      for (let cell = 1; cell < row.cells.length; cell += 1) row.cells[cell].textContent = "";
    });
    byId("doubts").textContent = "";
  }
}

function whole(text) {
  return Object.assign(document.createElement("span"), { textContent: text });
}

function number(value) {
  return value === null ? "?" : value.toFixed(2);
}

function sentence(text) {
  return `${text.charAt(0).toUpperCase()}${text.slice(1)}.`;
}
