"""What makes the page hard to read or to touch, looked for in the page itself."""

from __future__ import annotations

import numpy as np
from support.browser import Page


def scale(page: Page, plane: str) -> float:
    return float(page.driver.find_element("css selector", f"#plane-{plane} .scale").text.rstrip("×"))


def pinch(page: Page, plane: str, factor: float) -> None:
    """Two fingers on a plane, moved apart or together."""
    box = page.driver.execute_script(
        f"const m = document.querySelector('#plane-{plane} .marks'); m.scrollIntoView({{ block: 'center' }});"
        "const b = m.getBoundingClientRect(); return [b.left + b.width / 2, b.top + b.height / 2]"
    )
    begin, end = (30.0, 30.0 * factor) if factor > 1 else (90.0, 90.0 * factor)

    def touch(kind: str, half: float | None) -> None:
        points = [] if half is None else [{"x": box[0] + s * half, "y": box[1], "id": n} for n, s in enumerate((-1, 1))]
        page.driver.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    touch("touchStart", begin)
    for half in np.linspace(begin, end, 6):
        touch("touchMove", float(half))
    touch("touchEnd", None)


def cut_texts(page: Page) -> list[str]:
    """Texts of the header and of the answer that are cut off, or out of the window."""
    return list(page.driver.execute_script(CUT_TEXTS))


CUT_TEXTS = """
return ['state', 'pose-age', 'reason', 'detail', 'hint', 'message-text'].map((id) => document.getElementById(id))
  .filter((e) => e.offsetParent !== null && e.textContent)
  .filter((e) => {
    const box = e.getBoundingClientRect();
    const out = box.left < 0 || box.right > innerWidth + 1 || box.bottom > innerHeight + 1;
    return out || e.scrollWidth > e.clientWidth + 1;
  }).map((e) => e.textContent);
"""
# What stands in one line: captions, the numbers below the trace, its title.
BROKEN_LINES = """
return [...document.querySelectorAll('.caption, #axes, #trace-panel h2')].filter((e) => e.offsetParent !== null)
  .filter((e) => {
    const boxes = [...e.children].map((one) => one.getBoundingClientRect()).filter((box) => box.width);
    const own = e.getBoundingClientRect();
    const lines = Math.max(...boxes.map((box) => box.bottom)) - Math.min(...boxes.map((box) => box.top)) > 28;
    const over = boxes.some((p, i) => boxes.some((q, j) => j > i && p.right > q.left + 1 && q.right > p.left + 1));
    return lines || over || boxes.some((box) => box.right > own.right + 1 || box.left < own.left - 1);
  }).map((e) => e.textContent);
"""
SMALL_TARGETS = """
return [...document.querySelectorAll('button, select, input, summary')].filter((e) => e.offsetParent !== null)
  .map((e) => [e.id || e.textContent, e.getBoundingClientRect()])
  .filter(([, box]) => box.height < 43.9 || box.width < 43.9)
  .map(([name, box]) => `${name} ${box.width}×${box.height}`);
"""
# WCAG 2: relative luminance, and (lighter + 0.05) / (darker + 0.05). What is disabled is exempt.
FAINT_TEXTS = """
const channels = (colour) => colour.match(/[\\d.]+/g).map(Number);
const over = (top, under) => { const a = top[3] ?? 1; return [0, 1, 2].map((i) => a * top[i] + (1 - a) * under[i]); };
const ground = (e) => {
  if (!e) return [0, 0, 0];
  const own = channels(getComputedStyle(e).backgroundColor);
  return (own[3] ?? 1) === 1 ? own : over(own, ground(e.parentElement));
};
const luminance = (rgb) => rgb.map((v) => v / 255).map((v) => (v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4))
  .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
const texts = [...document.querySelectorAll('body *')].filter((e) =>
  e.offsetParent !== null && !e.closest(':disabled, .unseen, .note, .u-wrap, option') &&
  [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim()));
return texts.map((e) => {
  const under = ground(e), ink = over(channels(getComputedStyle(e).color), under);
  const [low, high] = [luminance(ink), luminance(under)].sort((p, q) => p - q);
  return [e.id || e.className || e.textContent, (high + 0.05) / (low + 0.05)];
}).filter(([, ratio]) => ratio < 4.5).map(([name, ratio]) => `${name} ${ratio.toFixed(2)}`);
"""
LISTEN_LIKE_A_SCREEN_READER = """
window.heard = [];
for (const id of ['news', 'urgent-news'])
  new MutationObserver(() => {
    const text = document.getElementById(id).textContent;
    if (text) window.heard.push([id === 'urgent-news', text]);
  }).observe(document.getElementById(id), { childList: true, characterData: true, subtree: true });
"""
