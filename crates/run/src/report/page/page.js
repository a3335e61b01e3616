"use strict";
// Moves the members to the time of the slider: nodes move on straight lines from one recorded time to the next.
(() => {
    const element = (id) => document.getElementById(id);
    const digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    const value = new Map([...digits].map((digit, i) => [digit, i]));
    const numbers = (text) => {
        const list = new Float64Array(text.length / 2);
        for (let i = 0; i < list.length; i++) list[i] = 64 * value.get(text[2 * i]) + value.get(text[2 * i + 1]);
        return list;
    };

    const { marks, members } = JSON.parse(element("trajectories").textContent);
    const panels = document.querySelectorAll(".members svg");
    members.forEach((member, i) => {
        member.frames = member.frames.map(numbers);
        member.now = panels[i].querySelector(".now");
        member.nodes = panels[i].querySelector(".nodes");
        member.dotted = member.nodes.getAttribute("d") !== "";
    });

    // Index, and the share of the way to the next, of `t` among ascending `times`.
    const find = (times, t) => {
        let i = 0;
        while (i + 2 < times.length && times[i + 1] <= t) i++;
        if (times.length < 2) return [0, 0];
        return [i, Math.min(1, Math.max(0, (t - times[i]) / (times[i + 1] - times[i])))];
    };

    const draw = (member, t) => {
        const [i, share] = find(member.times, t);
        const from = member.frames[i];
        const to = member.frames[Math.min(i + 1, member.frames.length - 1)];
        const at = (k) => Math.round(from[k] + share * (to[k] - from[k]));
        const places = [];
        for (let k = 0; k < from.length; k += 2) places.push(`${at(k)} ${at(k + 1)}`);
        member.now.setAttribute("d", `M${places.join("L")}Z`);
        if (member.dotted) member.nodes.setAttribute("d", places.map((place) => `M${place}h0`).join(""));
    };

    const [slider, button, clock] = ["time", "play", "clock"].map(element);
    const last = Number(slider.max);
    const time = (place) => {
        const at = (place / last) * (marks.length - 1);
        const i = Math.min(Math.floor(at), marks.length - 2);
        return marks[i] + (at - i) * (marks[i + 1] - marks[i]);
    };
    const show = (t) => {
        const text = `t = ${Number(t.toPrecision(3))}${clock.dataset.unit}`;
        clock.textContent = text;
        slider.setAttribute("aria-valuetext", text);
        members.forEach((member) => draw(member, t));
    };

    // A run takes this many milliseconds, however many times there are.
    const duration = 8000;
    let playing = false;
    let place = 0;
    let before;
    const stop = () => {
        playing = false;
        button.textContent = "Play";
    };
    const step = (now) => {
        if (!playing) return;
        place = Math.min(last, place + (last * (now - (before ?? now))) / duration);
        before = now;
        slider.value = Math.round(place);
        show(time(place));
        if (place >= last) stop();
        else requestAnimationFrame(step);
    };
    button.addEventListener("click", () => {
        if (playing) return stop();
        playing = true;
        button.textContent = "Pause";
        place = Number(slider.value) >= last ? 0 : Number(slider.value);
        before = undefined;
        requestAnimationFrame(step);
    });
    slider.addEventListener("input", () => {
        stop();
        show(time(Number(slider.value)));
    });

    // A link may name a time: report.html#t=0.25.
    const follow = () => {
        const named = /^#t=([0-9.]+(?:e[+-]?[0-9]+)?)$/i.exec(location.hash);
        if (!named) return;
        const t = Math.min(marks[marks.length - 1], Math.max(marks[0], Number(named[1])));
        const [i, share] = find(marks, t);
        slider.value = Math.round(((i + share) / (marks.length - 1)) * last);
        stop();
        show(t);
    };
    addEventListener("hashchange", follow);
    // Browsers keep the place of the slider when a page is loaded again.
    show(time(Number(slider.value)));
    follow();
    element("controls").hidden = false;
})();
