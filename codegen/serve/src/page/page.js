"use strict";
(() => {
  const by = (id) => document.getElementById(id);
  const token = new URLSearchParams(location.search).get("token") || "";
  const addressed = (path, more) => `${path}?token=${token}${more || ""}`;
  // how long typing must pause before the text is sent, ms
  const PAUSE = 250;
  const TITLES = { view: "3D view", base: "Base parameters", check: "In words", report: "Report" };

  async function ask(path, body) {
    const answer = await fetch(path, {
      method: body === undefined ? "GET" : "POST",
      headers: { "x-regen-token": token, "content-type": "application/json" },
      body: body === undefined ? undefined : JSON.stringify(body),
    });
    const text = await answer.text();
    if (!answer.ok) throw Object.assign(new Error(text.trim() || answer.statusText), { status: answer.status });
    return JSON.parse(text);
  }
  function status(text, kind) {
    by("status").textContent = text;
    by("status").title = text;
    by("status").className = kind || "";
  }

  // ---- the files: each has its text, the text on the disk, and its place in the editor
  let files = [], open = 0;
  const isChanged = (file) => file.text !== file.saved;
  function tab(box, name, title, choose) {
    const button = document.createElement("button");
    button.type = "button"; button.id = name; button.textContent = title;
    button.setAttribute("role", "tab");
    button.onclick = choose;
    box.append(button);
    return button;
  }
  // of a list of tabs the chosen one is reached by Tab, the others from it by the arrows
  function marked(button, is) {
    button.setAttribute("aria-selected", is);
    button.tabIndex = is ? 0 : -1;
  }
  for (const box of [by("files"), by("parts")]) box.addEventListener("keydown", (e) => {
    const all = [...box.children], at = all.indexOf(document.activeElement);
    const to = { ArrowLeft: at - 1, ArrowRight: at + 1, Home: 0, End: all.length - 1 }[e.key];
    if (at < 0 || to === undefined) return;
    e.preventDefault();
    const button = all[(to + all.length) % all.length];
    button.focus(); button.click();
  });
  function names() {
    files.forEach((file, k) => {
      file.tab.textContent = file.name + (isChanged(file) ? " •" : "");
      file.tab.title = file.path;
      marked(file.tab, k === open);
    });
    by("save").disabled = !files.length || !isChanged(files[open]);
    document.title = (files.some(isChanged) ? "• " : "") + (files.length ? files[0].name : "regen");
  }
  function choose(k) {
    files[open].top = by("text").scrollTop;
    open = k;
    by("text").value = files[k].text;
    by("text").scrollTop = files[k].top || 0;
    names(); lines();
  }

  // ---- the editor
  let told = { mistakes: [], failures: [], parts: {} };
  function lines() {
    const wrong = new Set(told.mistakes.filter((m) => m.file === open).map((m) => m.line));
    const count = by("text").value.split("\n").length;
    const parts = [];
    for (let k = 1; k <= count; k++) {
      const row = wrong.has(k) ? document.createElement("b") : document.createTextNode(String(k));
      if (wrong.has(k)) row.textContent = String(k);
      parts.push(row, "\n");
    }
    by("numbers").replaceChildren(...parts);
    // as far down as the text, which may have a bar to scroll it sideways
    by("numbers").style.paddingBottom = `${8 + by("text").offsetHeight - by("text").clientHeight}px`;
    by("numbers").scrollTop = by("text").scrollTop;
  }
  by("text").addEventListener("scroll", () => { by("numbers").scrollTop = by("text").scrollTop; });
  let pause = null;
  by("text").addEventListener("input", () => {
    files[open].text = by("text").value;
    names(); lines();
    clearTimeout(pause);
    pause = setTimeout(send, PAUSE);
  });
  // Tab indents; after Escape it leads on, as everywhere else
  let leaving = false;
  by("text").addEventListener("blur", () => { leaving = false; });
  by("text").addEventListener("keydown", (e) => {
    if (e.key === "Escape") { leaving = true; return; }
    if (e.key === "Tab" && leaving) return;
    leaving = false;
    if (e.key === "Tab" && !e.shiftKey && !e.ctrlKey && !e.altKey) {
      e.preventDefault();
      // keeps what can be undone, which setting the value would not
      if (!document.execCommand("insertText", false, "  ")) by("text").setRangeText("  ");
    }
  });
  function go(mistake) {
    if (mistake.file !== open) choose(mistake.file);
    const all = by("text").value.split("\n");
    const before = all.slice(0, mistake.line - 1).reduce((sum, line) => sum + line.length + 1, 0);
    // columns count characters, and places in the text count units of UTF-16
    const into = [...(all[mistake.line - 1] || "")].slice(0, mistake.column - 1).join("").length;
    by("text").focus();
    by("text").setSelectionRange(before + into, before + into);
    const height = by("text").scrollHeight / Math.max(all.length, 1);
    by("text").scrollTop = Math.max(0, (mistake.line - 4) * height);
  }

  // ---- sending and asking
  let sent = 0, asking = false, lost = false;
  async function send() {
    try {
      sent = (await ask("/texts", { texts: files.map((f) => f.text) })).edit;
      follow();
    } catch (error) { status(`not sent: ${error.message}`, "wrong"); lost = true; setTimeout(recover, 1000); }
  }
  async function recover() {
    if (!lost) return;
    try { await ask("/state"); lost = false; send(); } catch { setTimeout(recover, 1000); }
  }
  async function follow() {
    if (asking) return;
    asking = true;
    try {
      for (let wait = 40; ; wait = Math.min(wait * 1.3, 400)) {
        const now = await ask("/state");
        if (now.edit >= sent) await show(now);
        if (!now.busy && now.edit >= sent) break;
        await new Promise((done) => setTimeout(done, wait));
      }
    } catch (error) {
      status(`regen serve does not answer: ${error.message}`, "wrong");
      lost = true; setTimeout(recover, 1000);
    } finally { asking = false; }
  }

  // ---- what came of it
  // the view of a new text is seen from where the one before was
  let camera = null;
  const view = by("frame-view");
  addEventListener("message", (e) => {
    if (e.source !== view.contentWindow || !e.data || !e.data.camera) return;
    camera = e.data.camera;
    view.dataset.camera = JSON.stringify(camera);
  });
  view.addEventListener("load", () => { if (camera) view.contentWindow.postMessage({ camera }, "*"); });
  const shown = {};
  let chosen = "view";
  function panel(part) { return by(`panel-${part}`); }
  function select(part) {
    chosen = part;
    for (const name of Object.keys(TITLES)) panel(name).hidden = name !== part;
    for (const button of by("parts").children) marked(button, button.id === `part-${part}`);
    draw();
  }
  async function show(now) {
    told = now;
    const doing = now.doing ? TITLES[now.doing] : "reading";
    const count = now.mistakes.length + now.failures.length;
    if (now.busy) status(now.seconds > 0.5 ? `${doing} … ${now.seconds.toFixed(1)} s` : `${doing} …`);
    else if (count) status(now.mistakes.length ? `${count} mistake${count > 1 ? "s" : ""}` : "incomplete", "wrong");
    else status(`up to date, ${now.seconds.toFixed(1)} s`, "good");
    document.body.dataset.state = now.busy ? "busy" : count ? "wrong" : "good";
    if (!now.busy || count) mistakes();
    for (const [part, made] of Object.entries(now.parts)) panel(part).classList.toggle("stale", !made.current && !now.busy);
    await draw();
  }
  function mistakes() {
    const rows = told.mistakes.map((m) => {
      const row = document.createElement("li"), link = document.createElement("a");
      const file = m.file === null ? m.name : files.length > 1 ? files[m.file].name : "";
      link.textContent = `${file ? file + " " : ""}line ${m.line}, column ${m.column}`;
      if (m.file !== null) { link.tabIndex = 0; link.onclick = () => go(m); link.onkeydown = (e) => { if (e.key === "Enter") go(m); }; }
      row.append(link, m.message);
      if (m.hint) { const hint = document.createElement("small"); hint.textContent = m.hint; row.append(hint); }
      return row;
    });
    for (const failure of told.failures) {
      const row = document.createElement("li");
      row.textContent = (failure.part ? TITLES[failure.part] + ": " : "") + failure.message;
      rows.push(row);
    }
    by("mistakes").replaceChildren(...rows);
    lines();
  }
  /** Brings the chosen part up to date; the others wait until they are chosen. */
  async function draw() {
    const made = told.parts[chosen];
    if (!made || shown[chosen] === made.version) return;
    const part = chosen;
    shown[part] = made.version;
    if (part === "view" || part === "report") {
      // in place of the page before, so that the browser's Back leaves this page
      by(`frame-${part}`).contentWindow.location.replace(addressed(`/part/${part}`, `&version=${made.version}`));
      return;
    }
    try {
      const text = (await ask(`/part/${part}`)).text;
      if (part === "check") panel(part).querySelector("pre").textContent = text;
      else base(JSON.parse(text));
    } catch (error) { delete shown[part]; status(error.message, "wrong"); }
  }
  function base(found) {
    const head = panel("base").querySelector(".head");
    head.textContent = `${found.base.length} base parameters of ${found.parameters.length} parameters`;
    const cells = (tag, texts) => {
      const row = document.createElement("tr");
      for (const text of texts) { const cell = document.createElement(tag); cell.append(...[text].flat()); row.append(cell); }
      return row;
    };
    panel("base").querySelector("thead").replaceChildren(cells("th", ["", "kept", "with what is eliminated"]));
    const rows = found.base.map((one, k) => {
      const terms = one.terms.flatMap((term, n) => {
        const minus = term.coefficient.startsWith("-");
        const sign = n ? (minus ? " - " : " + ") : minus ? "-" : "";
        const size = term.coefficient.replace(/^-/, "");
        const factor = size === "1" ? "" : /[ +]/.test(size) ? `(${size}) ` : `${size} `;
        const dim = document.createElement("i");
        dim.textContent = sign + factor;
        return [dim, term.parameter];
      });
      return cells("td", [String(k + 1), one.label, terms]);
    });
    panel("base").querySelector("tbody").replaceChildren(...rows);
  }

  // ---- saving
  async function save() {
    const file = files[open], text = file.text;
    try {
      try { await ask("/save", { file: open, text }); } catch (error) {
        if (error.status !== 409 || !confirm(`${file.name}: ${error.message}. Write over it?`)) throw error;
        await ask("/save", { file: files.indexOf(file), text, over: true });
      }
      file.saved = text;
      names();
      status(`${file.name}: saved`, "good");
    } catch (error) { status(`${file.name}: not saved: ${error.message}`, "wrong"); }
  }
  by("save").onclick = save;
  addEventListener("resize", () => { if (files.length) lines(); });
  addEventListener("keydown", (e) => {
    if ((e.ctrlKey || e.metaKey) && e.key === "s") { e.preventDefault(); if (!by("save").disabled) save(); }
  });
  addEventListener("beforeunload", (e) => { if (files.some(isChanged)) e.preventDefault(); });

  async function begin() {
    files = (await ask("/files")).files.map((f) => ({ ...f, saved: f.text }));
    files.forEach((file, k) => { file.tab = tab(by("files"), `file-${k}`, file.name, () => choose(k)); });
    const parts = files.length > 1 ? ["view", "base", "check", "report"] : ["view", "base", "check"];
    for (const part of parts) tab(by("parts"), `part-${part}`, TITLES[part], () => select(part));
    by("text").value = files[0].text;
    names(); lines(); select("view");
    // what another page of this server sent may be there
    send();
  }
  begin().catch((error) => status(error.message, "wrong"));
})();
