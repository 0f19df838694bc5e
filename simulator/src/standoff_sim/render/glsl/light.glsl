// Sun, sky, shadow and haze, the same for ground and things. Offsets are site metres from the camera.
uniform vec3 to_sun, sun, sky, bounce, haze_colour;
uniform float haze_per_m;
uniform mat4 shadow_from_offset;      // to texture coordinates and depth of the shadow map, 0..1
uniform vec4 shadow_scale;            // metres a texel, penumbra texels per depth, depth of one metre, size of a texel
uniform sampler2DShadow shadow_map;
uniform sampler2D shadow_depth;
uniform sampler2D openness;           // ambient occlusion of the drawn picture
uniform vec2 openness_scale;

const vec2 TAPS[8] = vec2[](
    vec2(-0.326, -0.406), vec2(0.519, 0.767), vec2(0.962, -0.195), vec2(-0.696, 0.457),
    vec2(0.185, -0.893), vec2(-0.203, 0.621), vec2(-0.840, -0.074), vec2(0.473, -0.480));

// How much of the sun a place sees: 0 .. 1. Texture samples are what costs on a processor without a graphics card,
// so things get fewer of them than the ground, and the search for what casts the shadow is left out.
float sunlit(vec3 offset, vec3 normal, bool on_ground) {
    float slope = clamp(1.0 - dot(normal, to_sun), 0.0, 1.0);
    vec3 at = (shadow_from_offset * vec4(offset + normal * shadow_scale.x * (0.6 + 1.8 * slope), 1.0)).xyz;
    at.z -= shadow_scale.z * shadow_scale.x * 0.7;
    float texel = shadow_scale.w;
    float radius = 0.9 * texel;
    if (on_ground) {
        float blocker = 0.0, blockers = 0.0;
        for (int i = 0; i < 4; i++) {
            float depth = texture(shadow_depth, at.xy + TAPS[2 * i] * texel * 4.0).r;
            float blocks = step(depth, at.z);
            blocker += depth * blocks;
            blockers += blocks;
        }
        float gap = blockers > 0.0 ? at.z - blocker / blockers : 0.0;
        radius = texel * clamp(gap * shadow_scale.y, 0.75, 24.0);
    }
    // Another turn of the taps at every pixel, in place of bands.
    float chance = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
    vec2 turn = normalize(vec2(chance - 0.5, fract(chance * 7.31) - 0.497)) * radius;
    mat2 rotation = mat2(turn.x, turn.y, -turn.y, turn.x);
    int taps = on_ground ? 6 : 4;
    float lit = 0.0;
    for (int i = 0; i < taps; i++) lit += texture(shadow_map, vec3(at.xy + rotation * TAPS[i], at.z));
    float beyond = any(greaterThan(abs(at.xy - 0.5), vec2(0.498))) ? 1.0 : smoothstep(125.0, 155.0, length(offset));
    return mix(lit / float(taps), 1.0, beyond);
}

vec3 sky_radiance(vec3 direction) {
    vec3 horizon = max(haze_colour, 1.15 * sky);
    float up = clamp(direction.z, 0.0, 1.0);
    return mix(mix(horizon, 0.85 * sky, sqrt(up)), bounce, smoothstep(0.0, -0.25, direction.z));
}

vec3 hazy(vec3 radiance, float away_m) {
    return mix(haze_colour, radiance, exp(-haze_per_m * away_m));
}

// GGX with Smith's and Schlick's approximations; radiance is relative, so the sun's is already divided by pi.
vec3 shade(vec3 albedo, vec3 normal, vec3 to_eye, float roughness, float metal, float lit, float open) {
    float n_eye = max(dot(normal, to_eye), 0.02), n_sun = max(dot(normal, to_sun), 0.0);
    vec3 mirror = mix(vec3(0.04), albedo, metal);
    vec3 diffuse = albedo * (1.0 - metal);
    vec3 halfway = normalize(to_eye + to_sun);
    float n_half = max(dot(normal, halfway), 0.0), eye_half = max(dot(to_eye, halfway), 0.0);
    float a = roughness * roughness, a2 = a * a, k = 0.5 * a;
    float spread = n_half * n_half * (a2 - 1.0) + 1.0;
    float peak = a2 / (spread * spread);
    float visible = 0.25 / ((n_eye * (1.0 - k) + k) * (n_sun * (1.0 - k) + k));
    float grazing = 1.0 - eye_half;
    float grazing2 = grazing * grazing;
    vec3 fresnel = mirror + (1.0 - mirror) * grazing2 * grazing2 * grazing;
    vec3 direct = sun * (lit * n_sun) * (diffuse + min(peak * visible, 60.0) * fresnel);
    float up = 0.5 + 0.5 * normal.z;
    vec3 ambient = diffuse * open * (sky * up + bounce * (1.0 - up));
    // Karis' fit of the environment's share of the specular lobe.
    vec4 r = roughness * vec4(-1.0, -0.0275, -0.572, 0.022) + vec4(1.0, 0.0425, 1.04, -0.04);
    float edge = min(r.x * r.x, exp2(-9.28 * n_eye)) * r.x + r.y;
    vec2 share = vec2(-1.04, 1.04) * edge + r.zw;
    vec3 reflected = sky_radiance(reflect(-to_eye, normal)) * (mirror * share.x + share.y) * mix(1.0, open, 0.7);
    return direct + ambient + reflected;
}
