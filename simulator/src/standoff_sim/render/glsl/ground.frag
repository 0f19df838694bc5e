// The ground's radiance at every pixel, whatever stands before it, from the depth of the ground alone. The colour pass
// then only copies it: lighting the ground's many small triangles one by one would cost several times as much.
uniform sampler2D picture, noise, ground_depth, slopes;
uniform vec4 extent;  // south-west corner and size of the grid
uniform vec2 samples; // of height, in x and y
uniform vec3 origin;
uniform vec2 depth_range;  // near, far
uniform mat3 offset_from_pixel;
out vec4 radiance;

void main() {
    float z = texelFetch(ground_depth, ivec2(gl_FragCoord.xy), 0).r * 2.0 - 1.0;
    float near = depth_range.x, end = depth_range.y;
    float forward = 2.0 * near * end / (end + near - z * (end - near));
    vec3 offset = offset_from_pixel * vec3(gl_FragCoord.xy - 0.5, 1.0) * forward;
    vec2 xy = origin.xy + offset.xy;
    float away = length(offset);
    vec3 to_eye = -offset / away;
    vec2 place = (xy - extent.xy) / extent.zw;
    // Outside the grid the picture goes on mirrored, and fades to its own mean.
    vec2 folded = 1.0 - abs(fract(0.5 * place) * 2.0 - 1.0);
    vec2 outside = max(abs(place - 0.5) - 0.5, 0.0) * extent.zw;
    float far = 1.0 - exp(-0.02 * (outside.x + outside.y));
    vec2 slope = texture(slopes, (clamp(place, 0.0, 1.0) * (samples - 1.0) + 0.5) / samples).rg;
    vec3 level = normalize(vec3(-slope, 1.0));
    float steep = 1.0 - smoothstep(0.5, 0.9, level.z);
    // A picture from above is drawn out to straw on walls: there it is blurred, and the noise runs down the wall.
    vec4 base = texture(picture, folded, 6.0 * far + 3.5 * steep);
    vec3 albedo = base.rgb * base.rgb;
    float wet = base.a * (1.0 - far);
    vec2 draped = xy + steep * (origin.z + offset.z) * normalize(slope + vec2(1e-4, 0.0));
    vec4 fine = texture(noise, draped * 0.29);
    vec4 broad = texture(noise, mat2(0.81, 0.59, -0.59, 0.81) * xy * 0.043);
    float puddle = smoothstep(0.78, 0.88, wet + 0.12 * (broad.r - 0.5));
    float rough = 1.0 - puddle;
    // Trodden and rolled places are smoother than loose ones; grass is the roughest of all.
    float loose = smoothstep(0.3, 0.75, broad.r);
    float leafy = clamp(16.0 * (albedo.g - albedo.r), 0.0, 1.0);
    albedo *= 1.0 + rough * (mix(0.3 + 0.4 * loose, 1.5, leafy) * (fine.r - 0.5) + 0.4 * (broad.r - 0.5));
    float stone = fine.g * smoothstep(0.45, 0.85, broad.g + broad.r) * (1.0 - leafy);
    vec3 stony = mix(albedo, vec3(dot(albedo, vec3(0.3, 0.5, 0.2))), 0.5) * (0.85 + 0.6 * fine.r);
    albedo = mix(albedo, stony, 0.4 * stone * rough);
    // Wet soil is darker and fuller in colour; how far it creeps up differs from clod to clod.
    float damp = smoothstep(0.05, 0.75, wet + 0.25 * rough * (fine.r + broad.b - 1.0) * smoothstep(0.0, 0.1, wet));
    albedo = mix(albedo, albedo * (0.22 + 1.3 * albedo), damp);
    vec3 normal = level;
    normal = normalize(normal - rough * vec3((0.7 + 0.6 * loose) * (fine.ba - 0.5), 0.0));
    normal = normalize(mix(normal, vec3(0.0, 0.0, 1.0), puddle));
    // Between mud and water there is nothing half as smooth: its broad gleam would draw a white line along the shore.
    float roughness = puddle > 0.5 ? 0.07 : mix(0.95, 0.68, smoothstep(0.2, 0.8, wet));
    float open = texture(openness, gl_FragCoord.xy * openness_scale).r;
    float lit = dot(normal, to_sun) > 0.0 ? sunlit(offset, level, true) : 0.0;
    vec3 light = shade(clamp(albedo, 0.0, 0.9), normal, to_eye, roughness, 0.0, lit, open);
    radiance = vec4(min(hazy(light, away), vec3(30.0)), 1.0);
}
