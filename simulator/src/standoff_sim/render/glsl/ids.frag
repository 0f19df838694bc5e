flat in uint v_id;
out uint id;

void main() {
    id = v_id;
}
