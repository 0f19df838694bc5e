in vec3 position;
#ifdef IDS
flat out uint v_id;
#endif
uniform mat4 clip_from_offset;
uniform vec3 origin;

void main() {
    gl_Position = clip_from_offset * vec4(position - origin, 1.0);
#ifdef IDS
    v_id = 0u;
#endif
}
