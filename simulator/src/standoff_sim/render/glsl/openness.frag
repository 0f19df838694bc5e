// Ambient occlusion at reduced size from the depth of the id pass: how much of the sky a pixel misses.
uniform sampler2D depth;
uniform mat3 camera_from_pixel;  // of a full-size pixel centre, forward component 1
uniform vec4 depth_range;        // near, far, step in full-size pixels, focal length
out float open;

float forward(vec2 pixel) {
    float z = texelFetch(depth, ivec2(pixel), 0).r * 2.0 - 1.0;
    return 2.0 * depth_range.x * depth_range.y / (depth_range.y + depth_range.x - z * (depth_range.y - depth_range.x));
}

vec3 point(vec2 pixel) {
    pixel = clamp(pixel, vec2(0.0), vec2(textureSize(depth, 0) - 1));
    return camera_from_pixel * vec3(pixel, 1.0) * forward(pixel);
}

void main() {
    float step_px = depth_range.z;
    vec2 pixel = floor(gl_FragCoord.xy * step_px);
    vec3 centre = point(pixel);
    vec3 right = point(pixel + vec2(2.0, 0.0)) - centre, left = centre - point(pixel - vec2(2.0, 0.0));
    vec3 below = point(pixel + vec2(0.0, 2.0)) - centre, above = centre - point(pixel - vec2(0.0, 2.0));
    vec3 across = abs(right.z) < abs(left.z) ? right : left;
    vec3 down = abs(below.z) < abs(above.z) ? below : above;
    vec3 normal = normalize(cross(down, across));  // towards the camera
    float radius_px = clamp(2.2 * depth_range.w / centre.z, 3.0 * step_px, 220.0);
    float turn = 6.2832 * fract(52.9829189 * fract(dot(floor(gl_FragCoord.xy), vec2(0.06711056, 0.00583715))));
    float hidden = 0.0;
    const int TAPS = 18;
    for (int i = 0; i < TAPS; i++) {
        float share = (float(i) + 0.5) / float(TAPS);
        float angle = turn + 2.39996 * float(i);
        vec3 toward = point(pixel + radius_px * share * sqrt(share) * vec2(cos(angle), sin(angle))) - centre;
        float squared = dot(toward, toward);
        float rise = max(dot(toward, normal) - 0.015 - 0.0007 * centre.z, 0.0);
        hidden += rise * inversesqrt(squared + 0.001) / (1.0 + 0.25 * squared);
    }
    open = max(exp(-4.5 * hidden / float(TAPS)), 0.1);
}
