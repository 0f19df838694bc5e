in vec3 position, normal;
uniform mat4 clip_from_offset;
uniform vec3 origin;
out vec3 v_offset, v_normal;
out vec2 v_xy;

void main() {
    v_offset = position - origin;
    v_normal = normal;
    v_xy = position.xy;
    gl_Position = clip_from_offset * vec4(v_offset, 1.0);
}
