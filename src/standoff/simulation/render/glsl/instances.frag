in vec3 v_offset, v_normal, v_albedo, v_object, v_object_normal;
in float v_dust;
flat in vec4 v_gloss;    // roughness, metalness, bump, share of dust that sticks
flat in vec4 v_pattern;  // grain's contrast, stains' contrast, stains' darkening, colour variation
flat in vec4 v_stretch;  // tiles per metre along and across, stains' tiles per metre, glow of retro-reflection
flat in float v_side;
uniform sampler2D noise;
uniform vec3 dust_colour;
out vec4 radiance;

void main() {
    float away = length(v_offset);
    vec3 to_eye = -v_offset / away;
    vec3 normal = normalize(v_normal) * (gl_FrontFacing ? v_side : -v_side);
    vec3 facing = abs(v_object_normal);
    vec2 at = facing.z > max(facing.x, facing.y) ? v_object.xy : (facing.x > facing.y ? v_object.yz : v_object.xz);
    vec4 grain = texture(noise, at * v_stretch.xy);
    vec4 stain = texture(noise, at.yx * v_stretch.z + 0.37);
    vec3 albedo = v_albedo * (1.0 + v_pattern.x * (grain.r - 0.5) + v_pattern.y * (stain.r - 0.5));
    float dirt = smoothstep(0.52, 0.78, stain.r);
    albedo *= 1.0 - v_pattern.z * dirt;
    albedo *= 1.0 + v_pattern.w * (stain.b - 0.5) * vec3(1.0, 0.1, -0.8);
    float up = 0.5 + 0.5 * normal.z;
    float dust = clamp(v_dust * v_gloss.w * (0.35 + 1.0 * up * up) * (0.3 + 1.4 * stain.r) + 0.3 * v_dust * (grain.r - 0.5), 0.0, 0.95);
    albedo = clamp(mix(albedo, dust_colour * (0.9 + 0.2 * grain.r), dust), 0.0, 0.9);
    float roughness = mix(v_gloss.x + 0.15 * (stain.r - 0.5), 0.95, dust);
    normal = normalize(normal + v_gloss.z * (1.0 - dust) * vec3(grain.ba - 0.5, 0.0));
    float open = texture(openness, gl_FragCoord.xy * openness_scale).r;
    float lit = dot(normal, to_sun) > 0.0 ? sunlit(v_offset, normal) : 0.0;
    vec3 light = shade(albedo, normal, to_eye, clamp(roughness, 0.06, 1.0), v_gloss.y * (1.0 - dust), lit, open);
    radiance = vec4(min(hazy(light, away), vec3(30.0)), 1.0);
}
