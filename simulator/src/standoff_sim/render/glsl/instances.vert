in vec3 position, normal;
in vec4 albedo;
in vec2 surface_height;
in vec4 pose_x, pose_y, pose_z, tint_dust;
in vec2 id_seed;
uniform mat4 clip_from_offset;
uniform vec3 origin;
out vec3 v_offset, v_normal, v_object;
out vec4 v_albedo_dust;
flat out float v_surface;  // number of the Surface; the sign says whether the pose mirrors

void main() {
    vec4 local = vec4(position, 1.0);
    vec3 site = vec3(dot(pose_x, local), dot(pose_y, local), dot(pose_z, local));
    v_offset = site - origin;
    gl_Position = clip_from_offset * vec4(v_offset, 1.0);
    mat3 linear = transpose(mat3(pose_x.xyz, pose_y.xyz, pose_z.xyz));
    mat3 cofactors = mat3(cross(linear[1], linear[2]), cross(linear[2], linear[0]), cross(linear[0], linear[1]));
    float side = dot(linear[0], cofactors[0]) < 0.0 ? -1.0 : 1.0;
    v_normal = normalize(cofactors * normal) * side;
    v_surface = (surface_height.x + 1.0) * side;
    vec3 scale = vec3(length(linear[0]), length(linear[1]), length(linear[2]));
    v_object = position * scale + 7.0 * fract(id_seed.y * vec3(1.0, 3.7, 9.1));
    v_albedo_dust.rgb = albedo.rgb * mix(vec3(1.0), tint_dust.rgb, albedo.a);
    v_albedo_dust.a = tint_dust.a * (0.55 + 0.65 * exp(-1.6 * surface_height.y * scale.z));
}
