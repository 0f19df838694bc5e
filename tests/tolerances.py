"""Every tolerance that the tests use, and why it is what it is.

Never loosen one to get green: find out why it fails first.
"""

from __future__ import annotations

GEOMETRY_REL = 1e-9
"""Closed-form geometry in float64: some hundred roundings, well-conditioned points."""

DISTORTION_PX = 1e-6
"""Against OpenCV's undistortPoints, which iterates to its own epsilon."""

GROUND_THROUGH_LENS_M = 1e-6
"""OpenCV projects, we undistort: DISTORTION_PX times some 0.1 m a pixel on ground 60 m away, and some to spare."""

DARKNET_DECODED = 1e-3
"""Against OpenCV's Darknet importer, as fractions of the input and as probabilities: float32 sums in 75 layers."""

ONNX_LOGIT = 2e-3
"""ONNX Runtime against torch before the last sigmoid or exp: float32 sums in another order."""

ONNX_SIGMOID = 5e-7
"""ONNX Runtime's sigmoid is a fraction plus a half: some float32 roundings of 0.5 (6e-8 each), however small the score.
Against float64 a score of 8e-6 is off by 7e-8, 1 %, where torch is off by 0.01 %."""

NUMERICAL_DERIVATIVE_REL = 1e-5
"""Two central differences of the lens model with steps of 0.5 and 0.001 px: the third derivative and the rounding."""

ITERATED_INVERSE_PX = 1e-4
"""OpenCV's undistortPoints at the edge of the picture, stopped by its own 1e-8 in normalised units or 100 steps."""

FIRST_ORDER_SIGMA_REL = 0.12
"""A first-order standard error against 2000 random trials: 1.6 % is sampling, the rest the map's curvature."""

SURVEY_SIGMA_REL = 0.15
"""As FIRST_ORDER_SIGMA_REL with 400 trials (3.5 % sampling, three of those) and a fit in each."""

OFF_PLANE_M = 0.02
"""Surveyed points a quarter of a metre off their plane, moved onto it by a camera that is known to a fifth: 8 cm of
ground in the picture, of which a part in ten stays."""

RELIEF_COVERAGE = 0.9
"""Of 95 % intervals for the height of ground near and far from where it was surveyed: 40 fresh terrains gave 95.6 %,
and each of twelve stands or falls as a whole."""

SURVEY_COVERAGE = 0.88
"""Of 95 % intervals whose scatter has 8 degrees of freedom: Student's t says 91.4 %, less 2 x 1.6 % (300 trials)."""

GRAY_LEVELS = 3
"""The coded luma against gray computed from BGR: 8-bit roundings of three channels and of YUV before them."""

ENCODED_LEVELS = 2.0
"""Mean difference of what two H.264 films at crf 8 show of the same pixels, with other ones beside them."""

RESIZED_LEVELS = 1.5
"""Mean difference between two ways to scale or decode a smooth picture: chroma is scaled before it is converted."""

SWSCALE_LEVELS = 5
"""swscale's quick YUV to BGR conversion, OpenCV's VideoCapture included, turns full white into 250, 253, 251."""

CALIBRATED_FOCAL_REL = 1e-3
"""cv2.calibrateCamera on exact corners stored as float32; its iterations stop early along the distortion's valley."""

SOLVED_TWICE_REL = 1e-5
"""The same views given to cv2.calibrateCamera in two ways: its threads add up in any order, and it stops early."""

BOARD_CORNER_PX = 0.02
"""cornerSubPix on an axis-aligned drawn board: symmetric edges half-way between two pixel centres."""

RESIZED_CENTRE_PX = 0.02
"""Centre of a soft spot after OpenCV's resize, carried back: rounding to 8 bits, 0.008 px at worst."""

PEER_OVERLAP = 1e-6
"""supervision computes intersection over union in float32."""

EDGE_PX = 0.03
"""Mean position of a drawn edge: 64 samples a pixel (0.01 px) and 8-bit grey (0.005), and the parabola's own bias."""

REFERENCE_GROUND_REL = 0.005
"""Lengths of the reference's size, measured with it: corners good to 0.05-0.1 px of 100 px sides, on two sides."""

DRAWN_SITE_M = {"paper": 0.8, "paper+tls": 0.3, "oriented": 0.2, "fused": 0.2}
"""Root mean square error of distances of about 10 m through a square of 2.89 m that is 100 px wide: a corner error of
half a pixel is 1.5 cm on the square and grows with the square of the distance from it. Measured over three seeds: 0.51,
0.17 and 0.12 m at the worst."""

HULL_BOX_PX = 0.02
"""The box of a convex hull's vertices through a lens against that of all vertices: the lens bends straight lines."""

FOOT_ON_GROUND_M = 0.02
"""The lowest vertex of a person against the ground: the sole rests exactly, a knee may dip in far postures."""

RENDERED_EDGE_PX = {"pinhole": 0.05, "lens": 0.75, "shaded": 0.08}
"""Rendered outlines against projected corners. Pinhole: positions are snapped to 1/256 px. Lens: each pixel takes the
id of the nearest centre of the pinhole picture, at most half a diagonal away. Shaded: an edge through 25 lines of four
samples a pixel, and the grain of the surfaces beside it."""

VISIBLE_BOX_PX = 1.0
"""A projected box against pixels whose centres are covered: half a pixel of sampling on each side, and thin tips."""

SURVEYED_BOX_PX = 1.5
"""Boxes told without a picture against rendered ones at 1280x720, of what is mostly visible: VISIBLE_BOX_PX, and
roundness of the lumps that hide a rim of it. Measured over three sites: 1.2 at the worst."""

SURVEYED_SHARE = 0.08
"""Visible shares told without a picture against rendered ones: lumps have no holes. Measured: 0.05 at the worst."""

BOARD_IN_PICTURE_PX = 0.1
"""cornerSubPix on a rendered board through a lens, 4 samples a pixel, against the projected corners."""

FOOTING_IN_PICTURE_PX = 0.1
"""Lines fitted to a rendered footing's edges against its projected corners, as the issue asks."""

SCENE_DISTANCE_M = 1e-3
"""The clip's distances against the actors' own coordinates: what the issue asks; both are float64."""

FLAT_BOX_POINT_M = 0.08
"""A point of a flat 0.1 m square's box against the square's middle: half its diagonal, and a little for perspective."""

PEER_BOX_PX = 5e-3
"""supervision writes YOLO's shares with five digits: of 640 px, 0.0032 px of the centre, 0.0016 of half the width."""

CODED_FRAME_LEVELS = 2.5
"""Mean difference, less its mean, of pictures a quarter as wide before and after H.264 at 5.6 Mbit/s: 1.3 to 1.9."""

HALF_WEIGHTS = 1e-2
"""Scores, and boxes in parts of the input, with weights rounded to 11 bits: what the issue's brief asks."""

INT8_SCORE = 0.1
"""Scores of the drawn squares with eight-bit activations: 1/255 of a cell's colour is 0.12 of a logit, 0.03 of a score;
entropy calibration clips the loudest on top."""

FLOAT32_LOSS_REL = 2e-5
"""Sums of some thousand float32 logarithms against float64, in another order."""

FLOAT32_BOX_PX = 2e-3
"""Boxes of ONNX Runtime against torch at 128 px: float32 sums in another order, times exp."""

FOLLOWED_PX = 0.15
"""The largest error over the picture of a motion from some hundred points that are each good to 0.05-0.15 px."""

HALF_SEEN_PX = 0.8
"""As FOLLOWED_PX at the far side of a picture of which more than half is covered: the rest, extrapolated."""

COMPOSED_PX = 0.8
"""Two chains of some keyframes each, every link as good as FOLLOWED_PX, at the corners of pictures that turn."""

COASTED_PX = 6.0
"""Centres of boxes that coast for 0.6 s on velocities filtered in five frames a second while people's headings turn in
the picture; with the motion ignored it is more than 100."""
MARKER_CORNER_PX = 0.35
"""Largest of four corners' errors of a drawn marker of 24 px or more with a grey level of noise: 0.06 px on average."""

PDF_POINTS = 1e-3
"""A page's size as PDF writes it, in points of 0.35 mm, against its millimetres."""
CLEAN_CROWD_LOG = 0.1
"""Log scale by people who are all as tall as expected: arms a third wider than the body where 0.35 are drawn, the pull
of the priors on pitch and height, and a window of ten seconds."""

SIZES_COVERED = 0.80
"""Mean share of distances inside 95 % intervals, 40 crowds; distances of one crowd are right or wrong together, so as
40 trials of 0.91: 0.91 less 2.5 x 0.045."""

DERIVATIVE_REL = 2e-6
"""Central differences with steps of 1e-5: the third derivative, and the rounding of pixels of some thousand."""

TURN_RAD = 1e-7
"""There and back through a rotation's trace and sine: near half a circle the sine is small and its rounding grows."""

SOLID_CHI2 = 9.0
"""Mean of squares of errors of nine parameters, each by its standard error: 9 if those are right, less if too large."""

SOLID_CHI2_LEAST = 1.5
"""Measured: 3.3. Standard errors allow for stains, shading and compression, which drawn pictures do not have."""

SOLID_PX = 0.7
"""Corners of a drawn solid's top after a fit: 0.1 to 0.3 px where all edges are seen, more where few are."""

POLYGON_LENGTH_REL = 0.015
"""Lengths of some metres to some tens around a drawn polygon 100 px wide, after a search: up to three of its own widths
away. Measured over 72 pictures of five to twelve corners and known height: 0.003 in the median, 0.006 at the worst."""

CARRIED_PX = 1e-6
"""A view that explains a motion of the plane exactly, after Newton's last step."""

MAP_SIGMA_REL = 0.1
"""As FIRST_ORDER_SIGMA_REL with small errors, which see hardly any curvature: 600 trials (2.9 %, three of those)."""

KEYED_MAP_M = 1e-4
"""Lengths of ten metres with and without a new keyframe: corrections reach a keyframe by their first derivative."""

SAME_MAP_M = 1e-6
"""The same distances in two site frames: numerical derivatives and the order of sums."""
PROJECTED_PX = 1e-6
"""A pinhole camera taken apart into place and rotation and put together again, in float64 at 50 m."""

STATED_COVERAGE = 0.9
"""Of 95 % regions of a map in one clip: its errors are one error that lasts, so nearly all are in or all are out."""

FITTED_M = 1e-4
"""A camera 25 m away from exact corners of a 2.9 m square: the rest of a Gauss-Newton that stops at its rounding."""

PEER_POSE_M = 2e-3
"""Two least-squares poses of one square 27 m away: OpenCV stops its steps early along the flat direction."""

POSE_SIGMA_REL = 0.2
"""First-order standard errors of a pose against 120 trials: 6.5 % is sampling, three of those, and the curvature."""

CARRIED_SURVEY_PX = 1.5
"""A surveyed place carried along with a picture of 640 pixels: below a pixel the map is left as it is, and
following a noisy picture by its keyframe adds some tenths."""
FISHEYE_REL = 0.012
"""Lengths on the ground by a square of 100 px drawn 35 degrees off a fisheye's axis; measured: 0.005 at the worst."""

TRIALS_SHARE = 0.01
"""A share of 40 000 random trials: 0.0025 at the most, four of those."""

BLUR_REL = 0.1
"""Blur read off drawn edges: edges near each other add to it, and so do the pixels of the smaller picture."""

NOISE_REL = 0.05
"""Median of 15,000 second differences, rounded to grey levels, against the noise that was drawn."""

STANDING_REL = 0.06
"""A person seen in parallel against true perspective, from 12 m and more: his head is that much nearer."""

POOLED_COVERAGE = {"inside_95": 0.90, "inside_68": 0.65}
"""Shares of distances inside their stated intervals, four clips pooled: 0.99 and 0.87 in the test's own, 0.99 and 0.83
in 55 clips. Errors stated half as large get 0.86 and 0.61 in the test's own."""

COVERAGE_OF_A_KIND = 0.85
"""Of the 95 % intervals of one kind of pair over some thirty clips, a dozen of which show it at all."""

GOLDEN_REL = 0.01
"""Of a number of a golden table, or of 1 where it is smaller: to which another order of sums grows by chance."""

GOLDEN_SHARE = 0.99
"""Of the numbers of a column that must agree: a track may change its box in another frame by one."""

TOLD_IN_DEGREES_M = 0.01
"""Seven digits of a degree: half of 1.1 cm; and a plane that touches some metres further north."""
