// Position and entity id only: for the shadow map and the id pass.
in vec3 position;
in vec4 pose_x, pose_y, pose_z;
#ifdef IDS
in vec2 id_seed;
flat out uint v_id;
#endif
uniform mat4 clip_from_offset;
uniform vec3 origin;

void main() {
    vec4 local = vec4(position, 1.0);
    vec3 site = vec3(dot(pose_x, local), dot(pose_y, local), dot(pose_z, local));
    gl_Position = clip_from_offset * vec4(site - origin, 1.0);
#ifdef IDS
    v_id = uint(id_seed.x + 0.5);
#endif
}
