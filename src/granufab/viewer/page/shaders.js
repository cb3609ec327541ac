// The programs of the graphics unit: disks and spheres from squares, lines with round ends.

// What both share: the camera. `seen` turns a place into the view, `put` a place in the view into
// the clip space; `pixel` is the length of one,
// `unit` that of one of the page.
const CAMERA = `#version 300 es
precision highp float; precision highp int; precision highp sampler2D; precision highp usampler2D;
uniform mat3 turn; uniform vec2 scale; uniform vec2 shift; uniform float deep; uniform float pixel; uniform float unit;
uniform vec3 copy; uniform float fade; uniform float fog; uniform vec3 back;
`;
const PUT = `
vec4 put(vec2 place, float depth) { return vec4(place * scale + shift, -depth / deep, 1.0); }
float haze(float depth, float reach) { return fog * clamp(0.5 - 0.5 * depth / reach, 0.0, 1.0); }
`;

export const GRAIN_VERTEX = `${CAMERA}
layout(location = 0) in vec2 corner;
layout(location = 1) in uint code; // 27 grain + image
uniform sampler2D place; uniform usampler2D level; uniform sampler2D palette;
uniform mat3 lattice; uniform mat3 inverse; uniform vec3 begin; uniform float shrink; uniform float reach; uniform bool flat_;
out vec2 at; out vec2 part; flat out float radius; flat out float middle; flat out vec3 colour;
${PUT}
void main() {
  uint grain = code / 27u;
  uint image = code % 27u;
  ivec2 cell = ivec2(int(grain & 1023u), int(grain >> 10));
  vec4 found = texelFetch(place, cell, 0);
  vec3 steps = vec3(float(image % 3u), float(image / 3u % 3u), float(image / 9u)) - 1.0;
  vec3 where = found.xyz + lattice * steps + copy;
  vec3 seen = turn * where;
  radius = found.w * shrink;
  at = corner * (radius + pixel);
  part = (inverse * (where + vec3(at, 0.0) - begin)).xy;
  middle = seen.z;
  vec3 own = texelFetch(palette, ivec2(int(texelFetch(level, cell, 0).r), 0), 0).rgb;
  colour = mix(own, back, fade);
  gl_Position = put(seen.xy + at, flat_ ? 0.0 : seen.z + radius);
}`;

export const DISK_FRAGMENT = `${CAMERA}
uniform vec3 rim; uniform float rimWidth; uniform bool cut;
in vec2 at; in vec2 part; flat in float radius; flat in float middle; flat in vec3 colour;
out vec4 shown;
void main() {
  if (cut && (part.x < 0.0 || part.y < 0.0 || part.x > 1.0 || part.y > 1.0)) discard;
  float far = length(at);
  float cover = clamp((radius - far) / pixel + 0.5, 0.0, 1.0);
  if (cover <= 0.0) discard;
  float edge = clamp((far - radius + rimWidth) / pixel + 0.5, 0.0, 1.0) * min(rimWidth / pixel, 1.0);
  shown = vec4(mix(colour, mix(rim, back, fade), edge), cover);
}`;

// Round from the light of the upper left; the depth is that of the surface unless FAST.
const sphere = (fast) => `${CAMERA}
${fast ? "" : "#define TRUE_DEPTH"}
uniform vec3 rim; uniform float reach;
in vec2 at; flat in float radius; flat in float middle; flat in vec3 colour;
out vec4 shown;
${PUT}
void main() {
  float share = dot(at, at) / (radius * radius);
  float cover = clamp((radius - length(at)) / pixel + 0.5, 0.0, 1.0);
#ifdef TRUE_DEPTH
  if (cover <= 0.0) discard;
#else
  if (cover <= 0.5) discard;
  cover = 1.0;
#endif
  float up = sqrt(max(1.0 - share, 0.0));
  float light = 0.42 + 0.58 * max((-0.40 * at.x + 0.50 * at.y) / radius + 0.77 * up, 0.0);
  float depth = middle + radius * up;
  shown = vec4(mix(colour * light + vec3(0.10 * pow(light, 12.0)), back, haze(depth, reach)), cover);
#ifdef TRUE_DEPTH
  gl_FragDepth = 0.5 - 0.5 * depth / deep;
#endif
}`;
export const SPHERE_FRAGMENT = sphere(false);
export const FAST_SPHERE_FRAGMENT = sphere(true);

export const LINE_VERTEX = `${CAMERA}
layout(location = 0) in vec2 corner;
layout(location = 2) in vec3 start; layout(location = 3) in vec3 along; layout(location = 4) in vec2 dress;
uniform mat3 inverse; uniform vec3 begin; uniform vec3 tones[8]; uniform bool flat_; uniform float reach;
out vec2 at; out vec2 part; flat out float stretch; flat out float half_; flat out float strength; flat out vec3 colour;
${PUT}
void main() {
  vec3 from = turn * (start + copy);
  vec3 to = turn * (start + along + copy);
  float wanted = dress.x < 0.0 ? -dress.x * unit : dress.x;
  half_ = max(wanted, 0.5 * pixel);
  strength = clamp(wanted / half_, 0.12, 1.0);
  vec2 way = to.xy - from.xy;
  stretch = length(way);
  vec2 ahead = stretch > 1e-9 ? way / stretch : vec2(1.0, 0.0);
  float room = half_ + pixel;
  vec2 aside = vec2(-ahead.y, ahead.x);
  float end = corner.x * 0.5 + 0.5;
  vec2 place = mix(from.xy, to.xy, end) + ahead * corner.x * room + aside * corner.y * room;
  at = vec2(mix(-room, stretch + room, end), corner.y * room);
  part = (inverse * (vec3(place, 0.0) - begin)).xy;
  float depth = mix(from.z, to.z, end);
  colour = mix(mix(tones[int(dress.y)], back, fade), back, flat_ ? 0.0 : haze(depth, reach));
  gl_Position = put(place, flat_ ? 0.0 : depth + half_);
}`;

export const LINE_FRAGMENT = `${CAMERA}
uniform bool cut; uniform bool flat_;
in vec2 at; in vec2 part; flat in float stretch; flat in float half_; flat in float strength; flat in vec3 colour;
out vec4 shown;
void main() {
  if (cut && (part.x < 0.0 || part.y < 0.0 || part.x > 1.0 || part.y > 1.0)) discard;
  float far = length(vec2(at.x - clamp(at.x, 0.0, stretch), at.y));
  float cover = clamp((half_ - far) / pixel + 0.5, 0.0, 1.0) * strength;
  if (cover <= (flat_ ? 0.0 : 0.06)) discard;
  float across = min(far / half_, 1.0);
  float light = flat_ ? 1.0 : 0.62 + 0.38 * sqrt(1.0 - across * across);
  shown = vec4(colour * light, cover);
}`;
