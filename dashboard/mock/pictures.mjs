// Pictures that are drawn: each room has its colors, each frame its furniture.

const HUES = { kitchen: 35, hall: 210, bath: 180, bedroom: 280, study: 110, elsewhere: 0 };

function hash(text) {
  let value = 2166136261;
  for (const character of text) {
    value = Math.imul(value ^ character.codePointAt(0), 16777619);
  }
  return value >>> 0;
}

/** An SVG that shows a corner of the room, the same for the same name. */
export function picture(room, name) {
  const seed = hash(name);
  const hue = HUES[room] ?? hash(room) % 360;
  const light = 55 + (seed % 20);
  const at = 60 + (seed % 200);
  const shelf = 30 + ((seed >> 8) % 220);
  const tilt = (seed >> 16) % 30;
  return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 320 240" width="320" height="240">
<rect width="320" height="240" fill="hsl(${hue} 30% ${light}%)"/>
<path d="M0 ${170 - tilt} L${at} ${150 + tilt / 2} L320 ${175 + tilt / 3} V240 H0Z" fill="hsl(${hue} 22% ${light - 22}%)"/>
<path d="M${at} 0 V${150 + tilt / 2}" stroke="hsl(${hue} 20% ${light - 12}%)" stroke-width="3"/>
<rect x="${shelf}" y="${90 + tilt}" width="70" height="80" rx="4" fill="hsl(${(hue + 40) % 360} 35% ${light - 30}%)"/>
<rect x="${(shelf + 130) % 260}" y="30" width="56" height="64" fill="hsl(200 60% 88%)" stroke="hsl(${hue} 20% 30%)" stroke-width="4"/>
<circle cx="${(shelf + 60) % 320}" cy="${40 + tilt}" r="14" fill="hsl(48 80% 75%)"/>
</svg>`;
}
