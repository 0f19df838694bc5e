// In place of the ground's radiance: none, and how much light things take from level ground there. Drawn over a
// photograph of level ground, that is their shadow.
uniform sampler2D ground_depth;
uniform vec2 depth_range;  // near, far
uniform mat3 offset_from_pixel;
out vec4 radiance;

void main() {
    float z = texelFetch(ground_depth, ivec2(gl_FragCoord.xy), 0).r * 2.0 - 1.0;
    float near = depth_range.x, end = depth_range.y;
    float forward = 2.0 * near * end / (end + near - z * (end - near));
    vec3 offset = offset_from_pixel * vec3(gl_FragCoord.xy - 0.5, 1.0) * forward;
    float open = texture(openness, gl_FragCoord.xy * openness_scale).r;
    const vec3 LUMA = vec3(0.2126, 0.7152, 0.0722);
    float direct = dot(sun, LUMA) * max(to_sun.z, 0.0), diffuse = dot(sky, LUMA);
    float left = direct > 0.0 ? direct * sunlit(offset, vec3(0.0, 0.0, 1.0), true) : 0.0;
    radiance = vec4(vec3(0.0), 1.0 - (left + diffuse * open) / (direct + diffuse));
}
