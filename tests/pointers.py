"""What Git LFS leaves in place of a file that was not fetched."""

POINTER = (
    "version https://git-lfs.github.com/spec/v1\n"
    "oid sha256:4d7a214614ab2935c943f9e0ff69d22eadbb8f32b1258daaa5e2ca24d17e2393\n"
    "size 25949\n"
)
"""As in its specification."""
