in vec3 v_offset, v_normal, v_object;
in vec4 v_albedo_dust;
flat in float v_surface;
uniform vec4 surfaces[39];  // three rows of each Surface, see surfaces.py
uniform sampler2D noise;
uniform vec3 dust_colour;
out vec4 radiance;

void main() {
    float away = length(v_offset);
    vec3 to_eye = -v_offset / away;
    int first = 3 * (int(abs(v_surface) + 0.5) - 1);
    vec4 gloss = surfaces[first];        // roughness, metalness, bump, share of dust that sticks
    vec4 pattern = surfaces[first + 1];  // contrast of grain, of stains, darkness of dirt, drift of hue
    vec4 stretch = surfaces[first + 2];  // tiles per metre along, across, of stains; glow
    vec3 normal = normalize(v_normal) * (gl_FrontFacing == v_surface > 0.0 ? 1.0 : -1.0);
    vec3 facing = abs(cross(dFdx(v_object), dFdy(v_object)));
    vec2 at = facing.z > max(facing.x, facing.y) ? v_object.xy : (facing.x > facing.y ? v_object.yz : v_object.xz);
    vec4 grain = texture(noise, at * stretch.xy);
    vec4 stain = texture(noise, at.yx * stretch.z + 0.37);
    vec3 albedo = v_albedo_dust.rgb * (1.0 + pattern.x * (grain.r - 0.5) + pattern.y * (stain.r - 0.5));
    float dirt = smoothstep(0.52, 0.78, stain.r);
    albedo *= 1.0 - pattern.z * dirt;
    albedo *= 1.0 + pattern.w * (stain.b - 0.5) * vec3(1.0, 0.1, -0.8);
    float up = 0.5 + 0.5 * normal.z;
    float settled = gloss.w * (0.35 + up * up) * (0.3 + 1.4 * stain.r) + 0.3 * (grain.r - 0.5);
    float dust = clamp(v_albedo_dust.a * settled, 0.0, 0.95);
    albedo = clamp(mix(albedo, dust_colour * (0.9 + 0.2 * grain.r), dust), 0.0, 0.9);
    float roughness = mix(gloss.x + 0.15 * (stain.r - 0.5), 0.95, dust);
    normal = normalize(normal + gloss.z * (1.0 - dust) * vec3(grain.ba - 0.5, 0.0));
    float open = texture(openness, gl_FragCoord.xy * openness_scale).r;
    float lit = dot(normal, to_sun) > 0.0 ? sunlit(v_offset, normal, false) : 0.0;
    vec3 light = shade(albedo, normal, to_eye, clamp(roughness, 0.06, 1.0), gloss.y * (1.0 - dust), lit, open);
    float sunward = max(dot(to_eye, to_sun), 0.0);
    light += albedo * stretch.w * (0.3 * sky + sun * lit * sunward * sunward);
    radiance = vec4(min(hazy(light, away), vec3(30.0)), 1.0);
}
