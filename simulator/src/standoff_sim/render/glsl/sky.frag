uniform mat3 offset_from_pixel;
out vec4 radiance;

void main() {
    vec3 direction = normalize(offset_from_pixel * vec3(gl_FragCoord.xy - 0.5, 1.0));
    vec3 horizon = max(haze_colour, 1.15 * sky);
    float sunward = max(dot(direction, to_sun), 0.0);
    vec3 colour = mix(horizon, 0.85 * sky, pow(clamp(direction.z, 0.0, 1.0), 0.55));
    colour += sun * (0.25 * pow(sunward, 12.0) + 40.0 * smoothstep(0.99996, 0.99999, sunward));
    radiance = vec4(min(colour, vec3(30.0)), 1.0);
}
