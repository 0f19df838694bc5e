uniform sampler2D ground_radiance;
out vec4 radiance;

void main() {
    radiance = texelFetch(ground_radiance, ivec2(gl_FragCoord.xy), 0);
}
