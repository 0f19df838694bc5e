// A 4 x 4 box over the rotated taps of openness.frag.
uniform sampler2D rough;
out float open;

void main() {
    vec2 texel = 1.0 / vec2(textureSize(rough, 0));
    vec2 at = gl_FragCoord.xy * texel;
    open = 0.25 * (texture(rough, at + texel * vec2(-1.0, -1.0)).r + texture(rough, at + texel * vec2(1.0, -1.0)).r
        + texture(rough, at + texel * vec2(-1.0, 1.0)).r + texture(rough, at + texel * vec2(1.0, 1.0)).r);
}
