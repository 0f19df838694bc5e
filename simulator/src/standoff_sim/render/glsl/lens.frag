// Samples the drawn pinhole picture through the lens and develops it.
uniform sampler2D drawn;
uniform usampler2D drawn_ids;
uniform sampler2D undistorted;  // for each output pixel, column and row in the drawn picture; NaN outside the lens
uniform vec2 drawn_texel;
uniform mat3 blur;
uniform int blur_taps;
uniform vec3 gain;
uniform vec4 tone;              // contrast, lift, saturation, vignette
uniform vec2 picture_centre;
layout(location = 0) out vec4 colour;
layout(location = 1) out uint id;

vec3 encoded(vec3 linear) {
    return mix(12.92 * linear, 1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055, step(vec3(0.0031308), linear));
}

void main() {
    vec2 at = texelFetch(undistorted, ivec2(gl_FragCoord.xy), 0).xy;
    if (isnan(at.x)) {
        colour = vec4(0.0, 0.0, 0.0, 1.0);
        id = 0u;
        return;
    }
    id = texelFetch(drawn_ids, ivec2(floor(at + 0.5)), 0).r;
    vec3 light = vec3(0.0);
    if (blur_taps > 1) {
        vec3 end = blur * vec3(at, 1.0);
        vec2 path = end.xy / end.z - at;
        for (int i = 0; i < blur_taps; i++)
            light += texture(drawn, (at + 0.5 + path * ((float(i) + 0.5) / float(blur_taps) - 0.5)) * drawn_texel).rgb;
        light /= float(blur_taps);
    } else {
        light = texture(drawn, (at + 0.5) * drawn_texel).rgb;
    }
    vec2 corner = (gl_FragCoord.xy - picture_centre) / length(picture_centre);
    light *= gain * (1.0 - tone.w * dot(corner, corner));
    light = mix(vec3(dot(light, vec3(0.2126, 0.7152, 0.0722))), light, tone.z);
    light = max(light, vec3(0.0));
    if (tone.x != 1.0) light = 0.18 * pow(light / 0.18, vec3(tone.x));
    // Straight up to the knee, then a shoulder that reaches white only far above it.
    const float KNEE = 0.55;
    vec3 above = max(light - KNEE, vec3(0.0)) / (1.0 - KNEE);
    vec3 bent = above + 0.12 * above * above;
    light = min(light, vec3(KNEE)) + (1.0 - KNEE) * bent / (1.0 + bent);
    light = mix(vec3(tone.y), vec3(1.0), light);
    colour = vec4(encoded(clamp(light, 0.0, 1.0)).bgr, 1.0);
}
