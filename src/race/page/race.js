(() => {
  const film = document.getElementById("figure-race");
  const [slider, play, previous, next, now] =
    ["moment", "play", "previous", "next", "now"].map(id => document.getElementById(id));
  if (!film || !slider) return;
  const moments = [...film.querySelectorAll("[data-moment]")];
  const titles = [...film.querySelectorAll("[data-title]")].map(moment => moment.dataset.title);
  const last = titles.length - 1;
  let shown = 0;
  let timer = 0;

  const show = wanted => {
    shown = Math.max(0, Math.min(last, Math.round(wanted) || 0));
    for (const moment of moments) {
      moment.classList.toggle("shown", Number(moment.dataset.moment) === shown);
    }
    slider.value = shown;
    slider.setAttribute("aria-valuetext", titles[shown]);
    now.textContent = titles[shown];
  };
  const stop = () => {
    clearInterval(timer);
    timer = 0;
    play.textContent = "Play";
    now.setAttribute("aria-live", "polite");
  };
  const advance = () => {
    show(shown + 1);
    if (shown === last) stop();
  };
  const start = () => {
    if (shown === last) show(0);
    if (last === 0) return;
    play.textContent = "Pause";
    // A screen reader would fall behind the race.
    now.setAttribute("aria-live", "off");
    timer = setInterval(advance, Number(slider.dataset.pause));
  };
  const jump = wanted => {
    stop();
    show(wanted);
  };

  slider.addEventListener("input", () => jump(Number(slider.value)));
  // The keys of a slider, with whole moments for steps on every platform.
  const keys = {
    ArrowRight: () => shown + 1, ArrowUp: () => shown + 1, PageUp: () => shown + 10,
    ArrowLeft: () => shown - 1, ArrowDown: () => shown - 1, PageDown: () => shown - 10,
    Home: () => 0, End: () => last,
  };
  slider.addEventListener("keydown", event => {
    const wanted = keys[event.key];
    if (!wanted || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    jump(wanted());
  });
  previous.addEventListener("click", () => jump(shown - 1));
  next.addEventListener("click", () => jump(shown + 1));
  play.addEventListener("click", () => timer ? stop() : start());
  for (const control of [slider, play, previous, next]) control.disabled = false;
  // A reload may bring back the slider's place.
  show(Number(slider.value));
})();
